"""Rows that no force enters: they give their parameters up to a common factor only.

Rows that share a column share its scale, and one measured force fixes it for all of them. Where none does,
the rows that hang together are divided by one of their parameters: what they give are quotients, such as K/J.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.elimination.composites import Composites
from modelgen.symbolic.equations.identifiability import (
    FIELD,
    PRIME,
    add_modular,
    modular,
    random_values,
    reduce_modular,
    value_at,
)
from modelgen.symbolic.equations.sensor_reading import Candidate
from modelgen.symbolic.equations.signals import Term, differentiate


def scaled(
    chosen: Sequence[tuple[Candidate, int]], spec: ChainSpec, composites: Composites
) -> list[tuple[Candidate, int]]:
    """Divide the rows without a scale by the inertia they name first (any parameter if they name none).

    Rows and their divided versions are pairs of a candidate and how often it is differentiated.
    """
    found = list(chosen)
    inertias = [p.name for p in spec.parameters if p.role == "inertia"]
    terms_of = [differentiate(candidate.terms, times) for candidate, times in chosen]
    point = random_values(spec, FIELD)
    for group in _hanging_together(_without_scale(terms_of, spec, composites, point), terms_of):
        names = dict.fromkeys(
            t.parameter for index in group for t in terms_of[index] if t.parameter is not None
        )
        unit = next((name for name in names if name in inertias), next(iter(names)))
        for index in group:
            candidate, times = chosen[index]
            found[index] = (_divided(candidate, unit, composites), times)
    return found


def _without_scale(
    terms_of: Sequence[Sequence[Term]], spec: ChainSpec, composites: Composites, point: Mapping[str, Any]
) -> list[int]:
    """Return the rows whose columns may all be multiplied by a number: no other row minds.

    Other rows mind when the columns they share with it are independent there. Decided at a random point: the
    multiplied row is a sum of columns that no row sees.
    """
    forceless = [
        index
        for index, terms in enumerate(terms_of)
        if not any(term.parameter is None or term.parameter in spec.known for term in terms)
    ]
    columns: dict[str, dict[Any, int]] = {}
    for index, terms in enumerate(terms_of):
        for parameter, signal, coefficient in terms:
            if parameter is not None and parameter not in spec.known:
                add_modular(columns.setdefault(parameter, {}), {(index, signal): modular(coefficient)}, 1)
    pivots: dict[Any, dict[Any, int]] = {}
    for column in columns.values():
        reduce_modular(column, pivots)
        if column:
            pivots[next(iter(column))] = column
    free: dict[int, None] = {}
    for index in forceless:
        vector: dict[Any, int] = {("row", index): 1}
        for parameter, signal, coefficient in terms_of[index]:
            assert parameter is not None
            value = modular(coefficient) * _value(parameter, composites, point) % PRIME
            add_modular(vector, {(index, signal): value}, 1)
        reduce_modular(vector, pivots)
        lead = next((key for key in vector if key[0] != "row"), None)
        if lead is None:
            free.update(dict.fromkeys(key[1] for key in vector))
        else:
            pivots[lead] = vector
    return sorted(free)


def _value(parameter: str, composites: Composites, point: Mapping[str, Any]) -> int:
    composite = composites.named.get(parameter)
    if composite is None:
        return int(point[parameter])
    return int(value_at(composite.numerator, point, FIELD) / value_at(composite.denominator, point, FIELD))


def _hanging_together(indices: Sequence[int], terms_of: Sequence[Sequence[Term]]) -> list[list[int]]:
    """Group rows by the columns they share."""
    parent: dict[str, str] = {}

    def root(column: str) -> str:
        while parent.setdefault(column, column) != column:
            column = parent[column]
        return column

    columns_of = {i: [t.parameter for t in terms_of[i] if t.parameter is not None] for i in indices}
    for columns in columns_of.values():
        for column in columns[1:]:
            parent[root(column)] = root(columns[0])
    groups: dict[str, list[int]] = {}
    for index, columns in columns_of.items():
        groups.setdefault(root(columns[0]), []).append(index)
    return list(groups.values())


def _divided(candidate: Candidate, unit: str, composites: Composites) -> Candidate:
    terms = []
    for parameter, signal, coefficient in candidate.terms:
        assert parameter is not None
        if parameter == unit:
            terms.append(Term(None, signal, -coefficient))
        else:
            terms.append(Term(composites.quotient(parameter, unit), signal, coefficient))
    return candidate._replace(terms=tuple(terms), origin=f"{candidate.origin}, divided by {unit}")
