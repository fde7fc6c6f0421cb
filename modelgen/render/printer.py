"""Python source for numbers, sums and nested tuples; floats by repr, so they read back to the same bits."""

from __future__ import annotations

import pprint
from collections.abc import Iterable, Mapping
from fractions import Fraction

from modelgen.errors import signed_sum
from modelgen.symbolic.equations.signals import Exact

WIDTH = 100


def number(value: Exact) -> str:
    """Return the float nearest to an exact rational, as source."""
    return repr(float(value))


def weighted_sum(parts: Iterable[tuple[Exact, str]]) -> str:
    """Return ``a - 0.5 * b`` for [(1, "a"), (-1/2, "b")]; the empty sum is ``0.0``."""
    terms = ((c < 0, text if abs(c) == 1 else f"{number(c if c > 0 else -c)} * {text}") for c, text in parts)
    return signed_sum(terms) or "0.0"


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
