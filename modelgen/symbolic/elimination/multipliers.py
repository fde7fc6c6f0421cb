"""Exact multipliers of the equations, such that their sum leaves given slots only.

A system of linear equations over the polynomials in the parameters, with one solution up to a factor. Sparse
elimination without fractions: every row is divided by the common factor of its entries, which keeps them as
small as they can be.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from functools import reduce

from sympy.polys.rings import PolyElement

from modelgen.symbolic.elimination.ambiguity import Multiplier, Slot, raised
from modelgen.symbolic.elimination.common_factor import common_factor, exact_quotient

#: a row of the system: the coefficients by unknown
Row = dict[Multiplier, PolyElement]
#: A row with a coefficient of more terms than this would be of no use: no one could read or check it.
MOST_TERMS = 200
#: A product of more terms on the way does not lead to a short one, either: those that do need a few hundred.
MOST_PRODUCTS = 2000


class TooLong(Exception):
    """A multiplier has more than MOST_TERMS terms, or a product on the way to it more than MOST_PRODUCTS."""


def exact_multipliers(
    unknown: Collection[Multiplier],
    allowed: Collection[Slot],
    equations: Mapping[str, Mapping[Slot, PolyElement]],
    constants: bool,
) -> Row:
    """Return the multipliers, not zero, that cancel every slot which is not allowed; without common factor.

    Raises
    ------
    TooLong
        If one of them, or a product on the way, is too long.
    """
    system: dict[Slot, Row] = {}
    for body, power in unknown:
        for slot, value in raised(equations[body], power, constants):
            if slot not in allowed:
                system.setdefault(slot, {})[body, power] = value
    one = next(iter(next(iter(equations.values())).values())).ring.one
    solved = _echelon(list(system.values()))
    (free,) = [name for name in unknown if name not in {pivot for pivot, _ in solved}]
    return _substituted(solved, {free: one})


def _echelon(rows: list[Row]) -> list[tuple[Multiplier, Row]]:
    """Eliminate one unknown after another, the one that fills in least first."""
    solved = []
    while rows:
        used = Counter(name for row in rows for name in row)
        _, _, index, pivot = min(
            ((len(row) - 1) * (used[name] - 1), len(value), index, name)
            for index, row in enumerate(rows)
            for name, value in row.items()
        )
        chosen = rows.pop(index)
        solved.append((pivot, chosen))
        rows = [row for row in (_without(pivot, row, chosen) for row in rows) if row]
    return solved


def _without(pivot: Multiplier, row: Row, chosen: Row) -> Row:
    if pivot not in row:
        return row
    common = common_factor(row[pivot], chosen[pivot])
    ours, theirs = exact_quotient(chosen[pivot], common), exact_quotient(row[pivot], common)
    if (
        max(max(map(len, row.values())) * len(ours), max(map(len, chosen.values())) * len(theirs))
        > MOST_PRODUCTS
    ):
        raise TooLong
    total = {name: value * ours for name, value in row.items() if name != pivot}
    for name, value in chosen.items():
        if name != pivot:
            term = value * theirs
            total[name] = total[name] - term if name in total else -term
    return _primitive({name: value for name, value in total.items() if value})


def _primitive(row: Row) -> Row:
    if not row:
        return row
    common = reduce(common_factor, row.values())
    primitive = {name: exact_quotient(value, common) for name, value in row.items()}
    if max(len(value) for value in primitive.values()) > MOST_TERMS:
        raise TooLong
    return primitive


def _substituted(solved: list[tuple[Multiplier, Row]], found: Row) -> Row:
    """Insert backwards; what is found so far is multiplied rather than the new one divided."""
    for pivot, row in reversed(solved):
        rest = [row[name] * found[name] for name in row if name in found]
        if not rest:
            continue
        if max(len(row[name]) * len(found[name]) for name in row if name in found) > MOST_PRODUCTS:
            raise TooLong
        total = -reduce(lambda a, b: a + b, rest)
        if not total:
            continue
        common = common_factor(total, row[pivot])
        factor = exact_quotient(row[pivot], common)
        found = {name: value * factor for name, value in found.items()}
        found[pivot] = exact_quotient(total, common)
    return _primitive(found)
