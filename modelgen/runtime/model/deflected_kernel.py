"""DeflectedKernel: rows that hold positions of links or motors which rows give, linear about a point.

No sensor sees the link: the row of its spring gives its position, q = q_m - (Gamma - drive) / K, for given
drives and springs (`GivingRow`). Or none sees the motor: its deflection is what the link needs over K, q_m =
q + W theta / K. Rows that hold such positions are nonlinear in those parameters, and linear in the others.
About a point p they are sums again,

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
from modelgen.runtime.model.arm_channels import Speed, differentiated
from modelgen.runtime.model.arm_kernel import ArmKernel, Read, Sum
from modelgen.runtime.model.given_directions import Succession, Turning, given_directions
from modelgen.runtime.numerics.lagging import FURTHER, lagged

# Central differences of entries, which hold cosines of positions and squares of speeds.
STEPS = (1e-4, 1.0, 1.0)


class GivingRow(NamedTuple):
    """A row that gives a position: columns times parameters = left, to be solved for `channel`.

    `size` are two sums of channels: as large as what the spring carries, and as the motion of its joint.
    """

    channel: str
    left: Sum
    columns: Mapping[int, Sum]
    size: tuple[Sum, Sum]

    def acting(self, order: int) -> tuple[int, ...]:
        """Return the columns that the position counts in (0), of a spring, or its speed (1), of a damper."""
        key = differentiated(self.channel, order)
        return tuple(c for c, terms in self.columns.items() if any(name == key for _, name in terms))


class _Parts(NamedTuple):
    """A sum without the position that is sought; how often this counts, and its speed."""

    rest: Sum
    position: float
    speed: float


@dataclass(frozen=True, eq=False)
class DeflectedKernel:
    """Lines that hold positions which rows give, in SI.

    Attributes
    ----------
    inner : ArmKernel
        Lines that hold no given position; rows that give one may be made of them, and of their derivatives.
    kernel : ArmKernel
        Lines that hold given positions.
    sums : mapping of str to Sum
        Lines that are sums of given positions and directions, and of what is read.
    places : mapping of str to (int, int or None)
        Row and column of each line in the rows that are kept; no column on the left side.
    giving : tuple of GivingRow
    reads_of : mapping of str to Read
        What signals of the module that are read are made of.
    speeds : tuple of Speed
        Speeds of motors that are given.
    rows : tuple of int
        Rows that hold given positions.
    point : array, shape (columns,)
        Base parameters that the rows are linear about.
    motors_alone : bool
        Whether no sensor sees a link or a spring.
    sampled : bool
        Whether directions of given speeds are those at the samples (`given_directions`).
    """

    inner: ArmKernel
    kernel: ArmKernel
    sums: Mapping[str, Sum]
    places: Mapping[str, tuple[int, int | None]]
    giving: tuple[GivingRow, ...]
    reads_of: Mapping[str, Read]
    speeds: tuple[Speed, ...]
    rows: tuple[int, ...]
    point: FloatArray
    motors_alone: bool
    sampled: bool = False

    def at(self, point: FloatArray, sampled: bool = False) -> DeflectedKernel:
        """Return the same about another point, base parameters, shape (columns,), in SI."""
        return replace(self, point=point, sampled=sampled)

    @property
    def lag(self) -> float:
        """By how many s the damping of springs delays their deflections at most, at the point."""
        return max(abs(self.spring(row)[1]) for row in self.giving)

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns that given positions depend on."""
        return tuple(sorted({column for row in self.giving for column in row.columns}))

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the features, in the order of the lines."""
        slopes = [slope_key(row, column) for row in self.rows for column in self.columns]
        return (*self.places, *slopes, *(shift_key(row) for row in self.rows))

    @property
    def orders(self) -> Mapping[str, int]:
        """How often the filter differentiates a line: not at all."""
        return {}

    @property
    def reads(self) -> tuple[Read, ...]:
        """What the lines are formed from: of channels and features, and of `inner` lines."""
        keys = [*self.kernel.inputs, *(key for terms in self.sums.values() for _, key in terms)]
        wanted = [self.reads_of[key] for key in keys if key in self.reads_of]
        wanted += [(key, 0) for key in self.inner.keys]
        for row in self.giving:
            highest = self.orders_of(row)[1]
            for terms in (row.left, *row.columns.values()):
                for _, key in without_sought(terms, row.channel).rest:
                    if key != "1":
                        source, order = self.read_of(key)
                        wanted += [(source, order + more) for more in range(highest + 1)]
        return tuple(dict.fromkeys(wanted))

    def lines(
        self, read: Mapping[Read, FloatArray], succession: Succession | None = None
    ) -> Mapping[str, FloatArray]:
        """Return every feature, given positions and speeds, (N,) each, from what is read, shape (N,) each.

        Where samples are no `succession`, what the damping of springs delays is a series, to second order;
        what `read` holds of a given position is added to it (`beyond_series`).
        """
        count, given = len(next(iter(read.values()))), dict[str, FloatArray]()
        moves: dict[int, list[tuple[str, FloatArray]]] = {}
        for row in self.giving:
            position, slopes = self._given(row, read, count, succession)
            given |= {differentiated(row.channel, o): value for o, value in enumerate(position)}
            for column, slope in slopes.items():
                ordered = enumerate(slope)
                moves.setdefault(column, []).extend(
                    (differentiated(row.channel, o), value) for o, value in ordered
                )
        signals = {key: read[self.reads_of[key]] for key in self.kernel.inputs if key in self.reads_of}
        signals |= given
        found = dict(self.kernel.lines(signals)) if self.kernel.keys else {}
        found |= {key: read[key, 0] for key in self.places if key in self.inner.keys}
        low_pass = succession.low_pass if succession else None
        ways, turning = given_directions(self.speeds, signals, given, self.sampled, low_pass)
        values = {**given, **ways}
        for key, terms in self.sums.items():
            parts = (w * values[k] if k in values else self._sum(((w, k),), 0, read, count) for w, k in terms)
            found[key] = sum(parts, np.zeros(count))
        found |= given | {one.key: ways[one.key] for one in self.speeds}
        along = self._along(signals, found, turning) if self.rows else {}
        for place in self.rows:
            found[shift_key(place)] = shift = np.zeros(count)
            for column in self.columns:
                felt = [along[key][place] * by for key, by in moves[column] if place in along[key]]
                found[slope_key(place, column)] = total = sum(felt, np.zeros(count))
                shift += self.point[column] * total
        return found

    def read_of(self, key: str) -> Read:
        """Return the channel, or inner line, and the order that a signal is."""
        return (key, 0) if key in self.inner.keys else self.reads_of[key]

    def orders_of(self, row: GivingRow) -> tuple[int, int]:
        """Return the highest derivative of a given position that entries hold, and that is worked out."""
        highest = max(order for order in range(3) if differentiated(row.channel, order) in self.kernel.inputs)
        damped = any(without_sought(terms, row.channel).speed for terms in (row.left, *row.columns.values()))
        return highest, highest + (FURTHER if damped else 0)

    def _given(
        self, row: GivingRow, read: Mapping[Read, FloatArray], count: int, succession: Succession | None
    ) -> tuple[list[FloatArray], dict[int, list[FloatArray]]]:
        """Return a position with its derivatives, and what a parameter of the row moves each of them by."""
        kept, highest = self.orders_of(row)
        left = without_sought(row.left, row.channel)
        columns = {column: without_sought(terms, row.channel) for column, terms in row.columns.items()}
        stiff, lag = self.spring(row)

        def values(terms: Sum) -> list[FloatArray]:
            return [self._sum(terms, order, read, count) for order in range(highest + 1)]

        rests = {column: values(part.rest) for column, part in columns.items()}
        right, fs = values(left.rest), succession.fs if succession else None
        for column, rest in rests.items():
            right = [one - self.point[column] * other for one, other in zip(right, rest, strict=True)]
        exact = len(right) if self.motors_alone else kept + 1
        position = lagged([value / stiff for value in right], lag, fs, exact)
        for order in range(kept + 1):
            if (row.channel, order) in read:
                position[order] = position[order] + read[row.channel, order]
        slopes = {}
        for column, part in columns.items() if self.rows else ():
            springs = bool(part.position or part.speed)
            acting = [
                rest + part.position * position[o] + _later(part.speed, position, o) if springs else rest
                for o, rest in enumerate(rests[column])
            ]
            again = fs if self.motors_alone and springs else None
            slopes[column] = lagged([-one / stiff for one in acting], lag, again, exact)[: kept + 1]
        return position[: kept + 1], slopes

    def spring(self, row: GivingRow) -> tuple[float, float]:
        """Return what a position is multiplied by in the row that gives it, and by how many s it lags."""
        counted = [(float(self.point[column]), terms) for column, terms in row.columns.items()]
        parts = [(by, without_sought(terms, row.channel)) for by, terms in (*counted, (-1.0, row.left))]
        stiff = sum(value * part.position for value, part in parts)
        return stiff, sum(value * part.speed for value, part in parts) / stiff

    def _sum(self, terms: Sum, more: int, read: Mapping[Read, FloatArray], count: int) -> FloatArray:
        total = np.zeros(count)
        for weight, key in terms:
            if key == "1":
                total += 0.0 if more else weight
            else:
                source, order = self.read_of(key)
                total += weight * read[source, order + more]
        return total

    def _along(
        self, signals: Mapping[str, FloatArray], here: Mapping[str, FloatArray], turning: Turning
    ) -> dict[str, dict[int, FloatArray]]:
        """Return the derivatives of what rows hold by each given position, speed and acceleration."""
        found = {}
        for row in self.giving:
            for order, step in enumerate(STEPS):
                key = differentiated(row.channel, order)
                found[key] = self._along_sums(key, turning)
                if key not in self.kernel.inputs or not self.kernel.keys:
                    continue
                ahead = self._held(self.kernel.lines({**signals, key: signals[key] + step}))
                once = order == 2  # entries are linear in accelerations
                back = here if once else self.kernel.lines({**signals, key: signals[key] - step})
                behind, width = self._held(back), step if once else 2.0 * step
                for one in ahead:
                    if (change := ahead[one] - behind[one]).any():  # few rows hold any one position
                        found[key][one] = found[key].get(one, 0.0) + change / width
        return found

    def _held(self, lines: Mapping[str, FloatArray]) -> dict[int, FloatArray]:
        """Return what the kernel's lines hold at the point: entries times parameters, less the known."""
        found: dict[int, FloatArray] = {}
        for key in self.kernel.keys:
            row, column = self.places[key]
            found[row] = found.get(row, 0.0) + self._counted(column) * lines[key]
        return found

    def _along_sums(self, key: str, turning: Mapping[tuple[str, str], FloatArray]) -> dict[int, FloatArray]:
        """Return the derivatives of sums by a given position, speed or acceleration."""
        found: dict[int, FloatArray] = {}
        for line, terms in self.sums.items():
            row, column = self.places[line]
            for weight, name in terms:
                slope = np.ones(1) if name == key else turning.get((name, key))
                if slope is not None:
                    found[row] = found.get(row, 0.0) + self._counted(column) * weight * slope
        return found

    def _counted(self, column: int | None) -> float:
        """Return how often a line counts in what its row holds: on the left side, what is known."""
        return -1.0 if column is None else float(self.point[column])


def slope_key(row: int, column: int) -> str:
    """Return the key of what a parameter adds to a row through given positions."""
    return f"slope {row} {column}"


def shift_key(row: int) -> str:
    """Return the key of what is added to a row's left side."""
    return f"shift {row}"


def without_sought(terms: Sum, channel: str) -> _Parts:
    """Return a sum without a position that is sought, and what that and its speed are multiplied by."""
    weights = {key: weight for weight, key in terms}
    position, speed = (weights.pop(differentiated(channel, order), 0.0) for order in (0, 1))
    return _Parts(tuple((weight, key) for key, weight in weights.items()), position, speed)


def _later(weight: float, position: Sequence[FloatArray], order: int) -> FloatArray | float:
    return weight * position[order + 1] if weight and order + 1 < len(position) else 0.0
