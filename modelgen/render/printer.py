"""Python source for numbers, sums and nested tuples; floats by repr, so they read back to the same bits."""

from __future__ import annotations

import pprint
from collections.abc import Iterable, Mapping
from fractions import Fraction

from modelgen.symbolic.equations.signals import Exact

WIDTH = 100


def number(value: Exact) -> str:
    """Return the float nearest to an exact rational, as source."""
    return repr(float(value))


def weighted_sum(parts: Iterable[tuple[Exact, str]]) -> str:
    """Return ``a - 0.5 * b`` for [(1, "a"), (-1/2, "b")]; the empty sum is ``0.0``."""
    text = ""
    for coefficient, expression in parts:
        size = coefficient if coefficient > 0 else -coefficient
        factor = "" if size == 1 else f"{number(size)} * "
        if not text:
            text = f"{'-' if coefficient < 0 else ''}{factor}{expression}"
        else:
            text += f" {'-' if coefficient < 0 else '+'} {factor}{expression}"
    return text or "0.0"


def literal(value: object) -> str:
    """Return the source of nested tuples, dicts, strings and numbers, wrapped to the page."""
    return pprint.pformat(plain(value), width=WIDTH, sort_dicts=False)


def plain(value: object) -> object:
    """Turn exact rationals into floats and read-only containers into plain ones, at every depth."""
    if isinstance(value, Fraction):
        return float(value)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return tuple(plain(item) for item in value)
    return value
