"""Tests that take long begin first, in all processes, and none is lost or run twice."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tests.order_of_tests import in_order


def item(name: str, **mark: str) -> Any:
    """A test as pytest collects it: its name, and its mark where it is slow."""
    found = pytest.mark.slow(**mark).mark if mark else None
    return SimpleNamespace(nodeid=name, get_closest_marker=lambda _: found)


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("long", [0, 1, 2, 5, 40])
@pytest.mark.parametrize("still", [0, 7, 30])
def test_each_process_begins_with_what_takes_longest(count: int, long: int, still: int) -> None:
    items = [item(f"tests/runtime/a{k}") for k in range(30)]
    items += [item(f"tests/cli/b{k}", begins="first") for k in range(long)]
    items += [item(f"tests/spec/c{k}") for k in range(still)]
    names = [one.nodeid for one in in_order(items, count)]
    assert sorted(names) == sorted(one.nodeid for one in items)
    share = len(items) // count
    shares = [names[k * share : (k + 1) * share] for k in range(count)]
    begun = [sum("cli/b" in name for name in one) for one in shares]
    assert max(begun) - min(begun) <= 1
    for dealt, one in zip(begun, shares, strict=True):
        assert all("cli/b" in name for name in one[:dealt])
    for dealt, one in zip(begun[1:], shares[1:], strict=True):
        quick = [k for k, name in enumerate(one) if "spec/c" in name]
        assert quick == list(range(dealt, dealt + len(quick)))
