"""Named tests of the values in a generated module's tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from modelgen.magnitudes import LARGEST, SMALLEST
from modelgen.runtime.model.column_check import is_number

NUMBERS = f"numbers that are zero or from {SMALLEST:g} to {LARGEST:g}"


@dataclass(frozen=True)
class Kind:
    """A named test of one value."""

    description: str
    test: Callable[[Any], bool]


def is_text(value: Any) -> bool:
    """Return whether a value is a non-empty string."""
    return isinstance(value, str) and value != ""


def is_texts(value: Any) -> bool:
    """Return whether a value is a tuple of non-empty strings."""
    return isinstance(value, tuple) and all(is_text(item) for item in value)


def is_names(value: Any) -> bool:
    """Return whether a value is a tuple of different strings."""
    return is_texts(value) and len(dict.fromkeys(value)) == len(value)


def is_count(value: Any) -> bool:
    """Return whether a value is an integer, zero or more."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def is_combination(value: Any) -> bool:
    """Return whether a value is a tuple of pairs of a place and a number."""
    return isinstance(value, tuple) and all(
        isinstance(pair, tuple) and len(pair) == 2 and is_count(pair[0]) and is_number(pair[1])
        for pair in value
    )


def maps_texts(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return the test of a mapping of texts to values that pass a test."""
    return lambda value: isinstance(value, Mapping) and all(is_text(k) and test(v) for k, v in value.items())


def or_none(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return the test of None or of a value that passes a test."""
    return lambda value: value is None or test(value)


def one_of(choices: tuple[str, ...]) -> Kind:
    """Return the kind of a string that is one of these."""
    return Kind(f"one of {', '.join(choices)}", lambda value: isinstance(value, str) and value in choices)


TEXT = Kind("a non-empty string", is_text)
TEXT_OR_NONE = Kind("a non-empty string or None", or_none(is_text))
TEXTS = Kind("a tuple of strings", is_texts)
COUNT = Kind("an integer, zero or more", is_count)
# elimination and differentiation of the rows that modelgen derives stay below 20
ORDER = Kind("an integer from 0 to 99", lambda value: is_count(value) and value < 100)
PAIR_OR_NONE = Kind("a pair of strings or None", or_none(lambda value: is_names(value) and len(value) == 2))
LEVER = Kind(f"a number from {SMALLEST:g} to {LARGEST:g}", lambda value: is_number(value) and value > 0.0)
NAMES = Kind("a tuple of different strings", is_names)


def value_problems(module: Any, values: Mapping[str, Kind]) -> list[tuple[str, str]]:
    """Return (name, what is wrong) for values of a module that are absent or not of their kind."""
    found = []
    for name, kind in values.items():
        value = getattr(module, name, None)
        if value is None:
            found.append((name, "is absent"))
        elif not kind.test(value):
            found.append((name, f"is not {kind.description}"))
    return found
