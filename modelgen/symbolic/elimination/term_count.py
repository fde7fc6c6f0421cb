"""The length of an elimination in advance: terms of its rows, counted with integers.

The coefficients of a row are minors of the matrix A(s) of the equations. Each term of a principal minor is a
spanning forest of the links, rooted in inertias, friction and the ground (the matrix-tree theorem): with the
number 1 for every parameter the determinant counts them. A term of any other minor belongs to the forests of
its rows and to those of its columns (Cauchy and Binet), so the smaller of the two counts bounds it; so does
the permanent of the numbers of terms, which knows of known and shared parameters. A power of two stands for
s, large enough that the powers of s stand side by side in one integer: all coefficients are counted at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import comb, log

import numpy as np

from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.elimination.polynomials import Coordinates, Place, unit
from modelgen.symbolic.equations.equation_sums import contradicts_itself
from modelgen.symbolic.equations.newton import Equation
from modelgen.symbolic.equations.signals import Term

#: Bits of one power of s: a row of eight equations with a thousand links each does not count further.
BITS = 128
#: A determinant of more lines is that of its first ones, which counts less.
LARGEST_DETERMINANT = 300

#: terms by power of s, lowest first
Counts = list[int]


@dataclass(frozen=True)
class TermCount:
    """Bounds of the terms of a row.

    Attributes
    ----------
    total, longest : int
        Terms of all its coefficients, and of the longest.
    factors : int
        What is multiplied on the way, before terms cancel: products of terms, times the parameters in each.
    """

    total: int
    longest: int
    factors: int


class TermCounter:
    """Counts for one chain and one choice of coordinates."""

    def __init__(self, spec: ChainSpec, equations: Sequence[Equation], coordinates: Coordinates) -> None:
        #: coefficients that were counted so far
        self.counted = 0
        self._known = spec.known
        self._equations = {equation.body: equation for equation in equations}
        self._entries: dict[str, dict[Place, Counts]] = {}
        for equation in equations:
            self._entries[equation.body] = _entries(equation, coordinates, spec.known)
        single = all(table == ((unit(body), 1),) for body, table in coordinates.table.items())
        self._forests = _signed(equations) if single and not contradicts_itself(spec) else None

    def row(self, bodies: Sequence[str], others: Sequence[str]) -> TermCount:
        """Bound the terms of the row that eliminates the coordinates `others` from equations of `bodies`."""
        columns: list[Place] = [("", unit(other)) for other in others]
        weights = {body: self._minor([b for b in bodies if b != body], columns) for body in bodies}
        table: dict[Place, Counts] = {}
        for body in bodies:
            for place, entry in self._entries[body].items():
                if place not in columns:
                    table[place] = _sum(table.get(place, []), _product(entry, weights[body]))
        coefficients, products = [], sum(map(sum, table.values()))
        for place, counts in table.items():
            kind, functional = place
            if not kind and functional[0][0] in bodies:  # a determinant takes cancellations into account
                own = self._minor(bodies, [*columns, place])
                counts = [min(pair) for pair in zip(counts, own, strict=False)]
            coefficients += counts
        for body in bodies:
            forces = sum(_is_force_or_constant(term) for term in self._equations[body].terms)
            coefficients += forces * weights[body]
        self.counted += len(coefficients)
        names = self._names(bodies)
        most = comb(len(bodies) + names, names)  # shared names make few different products
        coefficients = [min(count, most) for count in coefficients]
        return TermCount(sum(coefficients), max(coefficients, default=0), products * (1 + names))

    def decimal_power(self, group: Sequence[str]) -> int:
        """Return the power of ten below the number of terms of the determinant of a group of any size."""
        first = list(group[:LARGEST_DETERMINANT])
        table = _signed([self._equations[body] for body in first], 0)
        matrix = [[table[row].get(column, 0) for column in first] for row in first]
        return int(np.linalg.slogdet(np.array(matrix, dtype=float))[1] / log(10.0))

    def _minor(self, rows: Sequence[str], columns: Sequence[Place]) -> Counts:
        """Bound the terms of a minor by power of s."""
        bounds = [self._permanent(rows, columns)]
        bodies = [functional[0][0] for _, functional in columns]
        if self._forests is not None and not any(kind for kind, _ in columns):
            bounds += [self._principal(rows), self._principal(bodies)]
        return [min(counts) for counts in zip_longest(*bounds, fillvalue=0)]

    def _principal(self, bodies: Sequence[str]) -> Counts:
        assert self._forests is not None
        forests = self._forests
        return _digits(_determinant([[forests[row].get(column, 0) for column in bodies] for row in bodies]))

    def _permanent(self, rows: Sequence[str], columns: Sequence[Place]) -> Counts:
        matrix = [[_packed(self._entries[row].get(column, [])) for column in columns] for row in rows]
        sums = {0: 1}
        for row in matrix:
            longer: dict[int, int] = {}
            for used, value in sums.items():
                for index, entry in enumerate(row):
                    if entry and not used >> index & 1:
                        key = used | 1 << index
                        longer[key] = longer.get(key, 0) + value * entry
            sums = longer
        return _digits(sums.get((1 << len(columns)) - 1, 0))

    def _names(self, bodies: Sequence[str]) -> int:
        """Return the number of different parameters in equations that are not known."""
        terms = (term for body in bodies for term in self._equations[body].terms)
        return len({t.parameter for t in terms if t.parameter is not None} - self._known.keys())


def _entries(equation: Equation, coordinates: Coordinates, known: Mapping[str, float]) -> dict[Place, Counts]:
    """Return the number of terms by power of s at every place of an equation."""
    found: dict[Place, set[tuple[str | None, int]]] = {}
    for parameter, signal, _ in equation.terms:
        if signal.kind == "coordinate":
            places: list[Place] = [("", functional) for functional, _ in coordinates.table[signal.name]]
        elif signal.kind in ("forward", "backward") and signal.order:
            places = [(signal.kind, unit(signal.name))]
        else:
            continue
        for place in places:
            found.setdefault(place, set()).add((None if parameter in known else parameter, signal.order))
    return {
        place: [sum(order == power for _, order in terms) for power in range(3)]
        for place, terms in found.items()
    }


def _signed(equations: Sequence[Equation], bits: int = BITS) -> dict[str, dict[str, int]]:
    """Return the matrix of the equations with 1 for every parameter, gears of ratio 1, and 2**bits for s."""
    table: dict[str, dict[str, int]] = {}
    for equation in equations:
        row = table.setdefault(equation.body, {})
        for _, signal, _ in equation.terms:
            if signal.kind == "coordinate":
                sign = 1 if signal.name == equation.body else -1
                row[signal.name] = row.get(signal.name, 0) + (sign << bits * signal.order)
    return table


def _determinant(matrix: list[list[int]]) -> int:
    """Return the determinant of integers, by elimination without fractions (Bareiss); pivots are positive."""
    rows = [list(row) for row in matrix]
    before = 1
    for step in range(len(rows) - 1):
        pivot = rows[step][step]
        for row in rows[step + 1 :]:
            for column in range(step + 1, len(rows)):
                row[column] = (row[column] * pivot - row[step] * rows[step][column]) // before
        before = pivot
    return rows[-1][-1] if rows else 1


def _is_force_or_constant(term: Term) -> bool:
    """Return whether a term is a force or constant between reversals."""
    return term.signal.kind != "coordinate" and (term.signal.kind == "force" or not term.signal.order)


def _sum(left: Counts, right: Counts) -> Counts:
    return [a + b for a, b in zip_longest(left, right, fillvalue=0)]


def _product(left: Counts, right: Counts) -> Counts:
    total = [0] * max(0, len(left) + len(right) - 1)
    for i, a in enumerate(left):
        for k, b in enumerate(right):
            total[i + k] += a * b
    return total


def _packed(counts: Counts) -> int:
    return sum(count << BITS * power for power, count in enumerate(counts))


def _digits(packed: int) -> Counts:
    found = []
    while packed:
        found.append(packed & (1 << BITS) - 1)
        packed >>= BITS
    return found
