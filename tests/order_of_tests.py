"""The order of the tests, of which pytest-xdist gives every process one share."""

from __future__ import annotations

import pytest

# nothing there simulates
STILL = ("tests/symbolic/", "tests/spec/", "tests/security/")


def in_order(items: list[pytest.Item], count: int) -> list[pytest.Item]:
    """Return the tests in `count` shares, each of which begins with its part of what takes longest.

    Every process but the first goes on with what simulates nothing: on a new checkout the first one
    compiles the simulation meanwhile, which takes half a minute, for all.
    """
    longest = [item for item in items if is_long(item)]
    rest = [item for item in items if not is_long(item)]
    still = [item for item in rest if item.nodeid.startswith(STILL)]
    others = [item for item in rest if not item.nodeid.startswith(STILL)]
    share = len(items) // count
    first = others[: max(share - len(longest[::count]), 0)]
    queue = [*still, *others[len(first) :]]
    ordered = [*longest[::count], *first]
    for process in range(1, count):
        dealt = longest[process::count]
        taken = max(share - len(dealt), 0)
        ordered += [*dealt, *queue[:taken]]
        queue = queue[taken:]
    return [*ordered, *queue]


def is_long(item: pytest.Item) -> bool:
    """Tell whether a test is marked as one that would keep a process busy when all others are done."""
    mark = item.get_closest_marker("slow")
    return mark is not None and mark.kwargs.get("begins", "") == "first"
