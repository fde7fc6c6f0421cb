"""Dependent columns written by kept ones, from changes that no row can see (exact elimination)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from modelgen.symbolic.arms.unseen_changes import Change, Key

#: How often every kept column counts in a dependent one.
Recipe = Mapping[int, Any]


def regrouping(changes: Iterable[Change], places: Mapping[Key, int]) -> dict[int, Recipe]:
    """Write as many columns as possible, the last ones first, by earlier ones.

    Parameters
    ----------
    changes : iterable of mappings
        Changes of the parameters that no row can see, W change = 0.
    places : mapping of key to int
        The column of every parameter that is to be estimated. Others may not change: they are eliminated.

    Returns
    -------
    dict
        For every dependent column how often each kept column counts in it; empty for a column of zeros.
    """
    pivots: dict[int, dict[int, Any]] = {}
    other: dict[Key, int] = {}
    for change in changes:
        vector = {
            places[key] if key in places else -1 - other.setdefault(key, len(other)): value
            for key, value in change.items()
            if value
        }
        while vector:
            lead = _first(vector)
            if lead not in pivots:
                scale = vector[lead]
                pivots[lead] = vector if scale == 1 else {k: v / scale for k, v in vector.items()}
                break
            _add(vector, pivots[lead], -vector[lead])
    dependent = sorted(lead for lead in pivots if lead >= 0)
    for lead in dependent:  # the others of an earlier column are reduced already
        vector = pivots[lead]
        for column in [c for c in vector if c in pivots and c != lead]:
            _add(vector, pivots[column], -vector[column])
    return {
        lead: {column: -value for column, value in sorted(pivots[lead].items()) if column != lead}
        for lead in dependent
    }


def _first(vector: Mapping[int, Any]) -> int:
    """Return what is eliminated first: parameters that may not change, then the last column."""
    lowest = min(vector)
    return lowest if lowest < 0 else max(vector)


def _add(vector: dict[int, Any], pivot: Mapping[int, Any], factor: Any) -> None:
    for column, value in pivot.items():
        total = vector.get(column, 0) + factor * value
        if total:
            vector[column] = total
        else:
            vector.pop(column, None)
