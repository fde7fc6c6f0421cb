"""DeflectedKernel: rows in which a link's position is made of others, linear about a point.

No sensor sees the link: the row of its spring gives its position, q = q_m - (Gamma - drive) / K, for given
drives and springs (`GivingRow`). The rows of the links are nonlinear in those parameters, and linear in the
links'. About a point p they are sums again,

    y + sum(slope_c p_c) = sum((entry_c + slope_c) x_c),    slope_c = d(sum(entry p)) / d q * d q / d p_c,

so that least squares of them is a step of Gauss and Newton, which ends where x = p; what is linear is solved
for anew in every step, as in variable projection.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_kernel import ArmKernel, Read, Sum

# Damping of a spring delays the deflection by D / K: so many terms of 1 / (1 + s D / K) = 1 - s D / K + ...
DAMPED = 2
# Central differences of the entries: of positions, whose cosines they hold (exact to the square of the step),
# and of speeds, in which they are quadratic.
STEPS = (1e-4, 1.0, 1.0)


class GivingRow(NamedTuple):
    """A row that gives a position: columns times parameters = left, to be solved for `channel`."""

    channel: str
    left: Sum
    columns: Mapping[int, Sum]

    @property
    def springs(self) -> tuple[int, ...]:
        """Columns that the position itself counts in: of the stiffness, unless it is known."""
        return tuple(c for c, terms in self.columns.items() if _parts(terms, self.channel).position)


class _Parts(NamedTuple):
    """A sum without the position that is sought; how often this counts, and its speed."""

    rest: Sum
    position: float
    speed: float


@dataclass(frozen=True, eq=False)
class DeflectedKernel:
    """Lines that hold positions which rows give.

    Attributes
    ----------
    kernel : ArmKernel
        The lines of the module in the rows that are kept.
    places : mapping of str to (int, int)
        Row and column of each of its entries.
    giving : tuple of GivingRow
    reads_of : mapping of str to Read
        What signals of the module that are read are made of.
    rows : tuple of int
        Rows that hold given positions.
    point : array, shape (columns,)
        Base parameters that the rows are linear about.
    """

    kernel: ArmKernel
    places: Mapping[str, tuple[int, int]]
    giving: tuple[GivingRow, ...]
    reads_of: Mapping[str, Read]
    rows: tuple[int, ...]
    point: FloatArray

    def at(self, point: FloatArray) -> DeflectedKernel:
        """Return the same about another point."""
        return replace(self, point=point)

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns that given positions depend on."""
        return tuple(sorted({column for row in self.giving for column in row.columns}))

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the features, in the order of the lines."""
        slopes = [slope_key(row, column) for row in self.rows for column in self.columns]
        return (*self.kernel.keys, *slopes, *(shift_key(row) for row in self.rows))

    @property
    def orders(self) -> Mapping[str, int]:
        """How often the filter differentiates a line: not at all."""
        return {}

    @property
    def reads(self) -> tuple[Read, ...]:
        """What the lines are formed from."""
        wanted = [self.reads_of[key] for key in self.kernel.inputs if key in self.reads_of]
        for row in self.giving:
            highest = self._orders(row)[1]
            for terms in (row.left, *row.columns.values()):
                for _, key in _parts(terms, row.channel).rest:
                    if key != "1":
                        source, order = self.reads_of[key]
                        wanted += [(source, order + more) for more in range(highest + 1)]
        return tuple(dict.fromkeys(wanted))

    def lines(self, read: Mapping[Read, FloatArray]) -> Mapping[str, FloatArray]:
        """Return every feature, shape (N,) each, from what is read, shape (N,) each."""
        count = len(next(iter(read.values())))
        signals = {key: read[self.reads_of[key]] for key in self.kernel.inputs if key in self.reads_of}
        moves: dict[int, list[tuple[str, FloatArray]]] = {}
        for row in self.giving:
            position, slopes = self._given(row, read, count)
            signals |= {_ordered(row.channel, o): value for o, value in enumerate(position)}
            for column, slope in slopes.items():
                moves.setdefault(column, []).extend(
                    (_ordered(row.channel, order), value) for order, value in enumerate(slope)
                )
        found = dict(self.kernel.lines(signals))
        along = self._along(signals, found)
        for place in self.rows:
            shift = np.zeros(count)
            for column in self.columns:
                total = sum((along[key][place] * by for key, by in moves[column]), np.zeros(count))
                found[slope_key(place, column)] = total
                shift += self.point[column] * total
            found[shift_key(place)] = shift
        return found

    def _orders(self, row: GivingRow) -> tuple[int, int]:
        """Return the highest derivative of a given position that entries hold, and that is worked out."""
        names = [_ordered(row.channel, order) for order in range(3)]
        highest = max(order for order, name in enumerate(names) if name in self.kernel.inputs)
        damped = any(_parts(terms, row.channel).speed for terms in (row.left, *row.columns.values()))
        return highest, highest + (DAMPED if damped else 0)

    def _given(
        self, row: GivingRow, read: Mapping[Read, FloatArray], count: int
    ) -> tuple[list[FloatArray], dict[int, list[FloatArray]]]:
        """Return a position with its derivatives, and what a parameter of the row moves each of them by."""
        kept, highest = self._orders(row)
        left = _parts(row.left, row.channel)
        columns = {column: _parts(terms, row.channel) for column, terms in row.columns.items()}
        stiff = sum(self.point[c] * part.position for c, part in columns.items()) - left.position
        damped = sum(self.point[c] * part.speed for c, part in columns.items()) - left.speed
        lag = damped / stiff

        def values(terms: Sum) -> list[FloatArray]:
            return [self._sum(terms, order, read, count) for order in range(highest + 1)]

        rests = {column: values(part.rest) for column, part in columns.items()}
        right = values(left.rest)
        for column, rest in rests.items():
            right = [one - self.point[column] * other for one, other in zip(right, rest, strict=True)]
        position = _lagging(right, stiff, lag)
        slopes = {}
        for column, part in columns.items():
            acting = [
                rest + part.position * position[order] + _later(part.speed, position, order)
                for order, rest in enumerate(rests[column])
            ]
            slopes[column] = _lagging([-one for one in acting], stiff, lag)[: kept + 1]
        return position[: kept + 1], slopes

    def _sum(self, terms: Sum, more: int, read: Mapping[Read, FloatArray], count: int) -> FloatArray:
        total = np.zeros(count)
        for weight, key in terms:
            if key == "1":
                total += 0.0 if more else weight
            else:
                source, order = self.reads_of[key]
                total += weight * read[source, order + more]
        return total

    def _along(
        self, signals: Mapping[str, FloatArray], here: Mapping[str, FloatArray]
    ) -> dict[str, dict[int, FloatArray]]:
        """Return the derivatives of what rows hold by each given position, speed and acceleration."""
        found = {}
        for row in self.giving:
            for order, step in enumerate(STEPS):
                key = _ordered(row.channel, order)
                if key not in self.kernel.inputs:
                    found[key] = dict.fromkeys(self.rows, np.zeros(1))
                    continue
                ahead = self._held(self.kernel.lines({**signals, key: signals[key] + step}))
                # entries are linear in accelerations
                behind = self._held(
                    here if order == 2 else self.kernel.lines({**signals, key: signals[key] - step})
                )
                width = step if order == 2 else 2.0 * step
                found[key] = {one: (ahead[one] - behind[one]) / width for one in self.rows}
        return found

    def _held(self, lines: Mapping[str, FloatArray]) -> dict[int, FloatArray]:
        """Return what each row's lines hold at the point: entries times parameters, less the known."""
        found: dict[int, FloatArray] = {}
        for key, (row, column) in self.places.items():
            found[row] = found.get(row, 0.0) + self.point[column] * lines[key]
        for key, row in self.kernel.left.items():
            found[row] = found.get(row, 0.0) - lines[key]
        return found


def slope_key(row: int, column: int) -> str:
    """Return the key of what a parameter adds to a row through given positions."""
    return f"slope {row} {column}"


def shift_key(row: int) -> str:
    """Return the key of what is added to a row's left side."""
    return f"shift {row}"


def _ordered(channel: str, order: int) -> str:
    return f"d{order}_{channel}" if order else channel


def _parts(terms: Sum, channel: str) -> _Parts:
    weights = {key: weight for weight, key in terms}
    position, speed = (weights.pop(_ordered(channel, order), 0.0) for order in (0, 1))
    return _Parts(tuple((weight, key) for key, weight in weights.items()), position, speed)


def _later(weight: float, position: Sequence[FloatArray], order: int) -> FloatArray | float:
    return weight * position[order + 1] if weight and order + 1 < len(position) else 0.0


def _lagging(values: Sequence[FloatArray], stiff: float, lag: float) -> list[FloatArray]:
    """Return x of stiff (x + lag x') = value, with its derivatives; `values` has those of the value."""
    found = []
    for order, value in enumerate(values):
        total = value
        for more in range(1, DAMPED + 1) if lag else ():
            if order + more < len(values):
                total = total + (-lag) ** more * values[order + more]
        found.append(total / stiff)
    return found
