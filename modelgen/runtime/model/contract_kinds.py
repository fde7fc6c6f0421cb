"""Named tests of the values in a generated module's tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
FILLED_NAMES = Kind("a non-empty tuple of different strings", lambda value: is_names(value) and value != ())
TEXTS_BY_NAME = Kind("a mapping of names to strings", maps_texts(is_text))
# values that modules of chains and of arms have
COMMON: dict[str, Kind] = {
    "TITLE": Kind("a string", lambda value: isinstance(value, str)),
    "SPEC_SHA256": TEXT,
    "PARAMETERS": NAMES,
    "BASE_PARAMETERS": FILLED_NAMES,
    "IDENTIFIABLE": NAMES,
    "KNOWN": Kind(f"a mapping of names to {NUMBERS}", maps_texts(is_number)),
    "ABSENT": TEXTS_BY_NAME,
    "UNITS": TEXTS_BY_NAME,
    "PARAMETER_SETS": Kind(
        f"a mapping of names to mappings of names to {NUMBERS}", maps_texts(maps_texts(is_number))
    ),
    "ROLES": Kind("a mapping of names to dicts", maps_texts(lambda value: isinstance(value, Mapping))),
}
Entries = Mapping[str, Mapping[str, Kind]]


def shape_problems(
    module: Any,
    values: Mapping[str, Kind],
    entries: Entries,
    role: Mapping[str, Kind],
    functions: Sequence[str],
) -> list[tuple[str, str]]:
    """Return (place, what is wrong) for what a module lacks or has in another shape.

    Parameters
    ----------
    module : module
    values, entries : mapping
        The kind of each value; and of each tuple of dicts the kinds of their entries.
    role : mapping
        The kinds of the entries of ROLES.
    functions : sequence of str
    """
    found = []
    for name, kind in values.items():
        value = getattr(module, name, None)
        if value is None:
            found.append((name, "is absent"))
        elif not kind.test(value):
            found.append((name, f"is not {kind.description}"))
    for name, kinds in entries.items():
        table = getattr(module, name, None)
        if not isinstance(table, tuple):
            found.append((name, "is absent" if table is None else "is not a tuple of dicts"))
            continue
        for index, entry in enumerate(table):
            found += _entry_problems(f"{name}[{index}]", entry, kinds)
    roles = getattr(module, "ROLES", None)
    for name, entry in roles.items() if isinstance(roles, Mapping) else ():
        found += _entry_problems(f"ROLES[{name!r}]", entry, role)
    return found + [
        (f"{name}()", "is absent") for name in functions if not callable(getattr(module, name, None))
    ]


def _entry_problems(place: str, entry: Any, kinds: Mapping[str, Kind]) -> list[tuple[str, str]]:
    if not isinstance(entry, Mapping):
        return [(place, "is not a dict")]
    found = [(f"{place}[{key!r}]", "is absent") for key in kinds if key not in entry]
    found += [(f"{place}[{key!r}]", "is unknown") for key in entry if key not in kinds]
    for key, kind in kinds.items():
        if key in entry and not kind.test(entry[key]):
            found.append((f"{place}[{key!r}]", f"is {entry[key]!r}, not {kind.description}"))
    return found
