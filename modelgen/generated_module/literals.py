"""The literals of a generated module: their values, read without executing them, and what they declare."""

from __future__ import annotations

import ast
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

LONGEST_LITERAL = 300_000  # entries; a thousand bodies have a tenth of that


@dataclass(frozen=True)
class Declared:
    """How many there are of each thing in a module's literals, and the names of what its formulas may use."""

    counts: Mapping[str, int]
    names: Mapping[str, frozenset[str]]


def literal_value(source: str) -> object:
    """Return the value of a literal.

    Raises
    ------
    ValueError
        When the source is no literal, or holds a text that is not seen as it is.
    """
    try:
        value: object = ast.literal_eval(source)
    except (SyntaxError, TypeError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"holds no literal ({type(error).__name__})") from error
    if isinstance(value, str) and hidden_character(value) is not None:
        raise ValueError("holds a text with control characters")
    return value


def hidden_character(text: str) -> str | None:
    """Return the first character that changes a text without being seen: control, direction, line end."""
    return next((c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")), None)


def declared_by(literals: Mapping[str, Any]) -> Declared:
    """Return what a module's literals declare; one of another form than modelgen's declares nothing."""
    inertias = [entry for entry in _entries(literals["ROLES"]) if entry.get("role") == "inertia"]
    friction = _entries(literals["FRICTION"])
    return Declared(
        counts={
            "row": len(_sequence(literals["ROWS"])),
            "column": len(_sequence(literals["BASE_PARAMETERS"])),
            "state": 2 * sum(len(_sequence(entry.get("bodies"))) for entry in inertias),
            "force": len(_sequence(literals["ACTUATORS"])),
            "friction": len(_sequence(literals["FRICTION"])),
            "reading": len(_sequence(literals["SENSORS"])),
        },
        names={
            "signal": _names(entry.get("key") for entry in _entries(literals["SIGNALS"])),
            "feature": _names(entry.get("key") for entry in _entries(literals["FEATURES"])),
            "parameter": _names([*_sequence(literals["PARAMETERS"]), *_keys(literals["KNOWN"])]),
            "estimated": _names(_sequence(literals["IDENTIFIABLE"])),
            "moved": _names(entry.get("body") for entry in friction if entry.get("asymmetric") is True),
        },
    )


def declared_by_arm(literals: Mapping[str, Any]) -> Declared:
    """Return what the literals of an arm's module declare."""
    return Declared(
        counts={
            "row": len(_sequence(literals["ROWS"])),
            "column": len(_sequence(literals["BASE_PARAMETERS"])),
            "nonzero": len(_sequence(literals["ENTRIES"])),
        },
        names={"parameter": _names([*_sequence(literals["PARAMETERS"]), *_keys(literals["KNOWN"])])},
    )


def _entries(value: object) -> list[dict[str, Any]]:
    """Return the dicts in a tuple, or among the values of a dict."""
    inner = value.values() if isinstance(value, dict) else _sequence(value)
    return [entry for entry in inner if isinstance(entry, dict)]


def _sequence(value: object) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else ()


def _keys(value: object) -> Iterator[Any]:
    yield from value if isinstance(value, dict) else ()


def _names(values: Iterable[object]) -> frozenset[str]:
    return frozenset(value for value in values if isinstance(value, str))
