"""How rows follow from their own past and from rows that share their noise: by what coefficients, how well.

Records that share the noise of their sensors say it together, or one alone where it is certainly different.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.least_squares.thresholds import (
    JOINT_ORDER,
    LEAST_POWER,
    SAMPLES_A_COEFFICIENT,
    SMALLEST_DEVIATION,
)
from modelgen.runtime.least_squares.whitening import akaike
from modelgen.runtime.numerics.qr_triangle import tall_triangle, triangle_of


@dataclass(frozen=True, eq=False)
class RowPrediction:
    """How a row follows from `terms`, pairs (row, lag), at instants of the grid; `spread` is its error's.

    `lost` is the number of coefficients that were estimated: those of several records count in parts.
    """

    terms: tuple[tuple[int, int], ...]
    shares: FloatArray
    spread: float
    instants: IntArray
    lost: float


@dataclass(frozen=True, eq=False)
class RowResiduals:
    """What the rows of a record leave.

    Attributes
    ----------
    residuals : tuple of array, shape (n,) each
        One a row, at `places` of the record's grid of `grid` instants.
    places : tuple of array of int, shape (n,) each
    grid : int
    least : tuple of float
        The rms below which a row's residual says nothing: white noise of that size counts as added.
    """

    residuals: tuple[FloatArray, ...]
    places: tuple[IntArray, ...]
    grid: int
    least: tuple[float, ...]

    @cached_property
    def series(self) -> FloatArray:
        """The residuals on the grid, zero where there are none, shape (rows, grid)."""
        return on_grid(self.residuals, self.places, self.grid)

    @cached_property
    def reach(self) -> IntArray:
        """How many samples without a gap end at each instant, shape (rows, grid)."""
        return np.stack([_past(place, self.grid) for place in self.places])


def on_grid(parts: Sequence[FloatArray], places: Sequence[IntArray], grid: int) -> FloatArray:
    """Return parts of rows, in their units, at their places of a grid, zero elsewhere, shape (rows, grid)."""
    series = np.zeros((len(places), grid))
    for line, part, place in zip(series, parts, places, strict=True):
        line[place] = part
    return series


def _past(place: IntArray, grid: int) -> IntArray:
    """Return how many samples without a gap end at each instant, shape (grid,)."""
    instants = np.arange(grid)
    missing = np.ones(grid, dtype=bool)
    missing[place] = False
    return np.asarray(instants - np.maximum.accumulate(np.where(missing, instants, -1)))


def _terms(row: int, related: Sequence[int], rises: Sequence[int], order: int) -> list[tuple[int, int]]:
    """Return what a row is predicted from.

    Its own past, that of rows differentiated as often, of those before it the present as well, and rows
    differentiated less often before and after. The other way round, twice differentiated rows would foretell
    what their sum does next, and no finite past would know of its mean.
    """
    terms = [(row, lag) for lag in range(1, order + 1)]
    for other in related:
        if rises[other] == rises[row]:
            terms += [(other, lag) for lag in range(0 if other < row else 1, order + 1)]
        elif rises[other] < rises[row]:
            terms += [(other, lag) for lag in range(-order, order + 1)]
    return terms


def predictions(
    row: int,
    related: Sequence[int],
    rises: Sequence[int],
    records: Sequence[RowResiduals],
    powers: Sequence[float],
) -> list[RowPrediction | None]:
    """Return how a row of each record follows from itself and related rows; None where few say that.

    By what all records say, or by a record's own: by what is expected to foretell more (`akaike`). `powers`
    are the mean squares of the row's errors of prediction from its own past, one a record.
    """
    share = len(_terms(row, related, rises, JOINT_ORDER)) / JOINT_ORDER
    seen = sum(int(np.sum(one.reach[row] > 0)) for one in records)
    order = min(JOINT_ORDER, int(seen / (SAMPLES_A_COEFFICIENT * share)))
    terms = _terms(row, related, rises, order)
    none: list[RowPrediction | None] = [None] * len(records)
    if order < 1 or all(other == row for other, _ in terms):
        return none
    told = [_Told.of(row, terms, one) for one in records]
    if sum(one.n for one in told) < SAMPLES_A_COEFFICIENT * len(terms):
        return none
    common, found = _Told.joined(told, powers), list(none)
    shares = common.shares()
    for k, one in enumerate(told):
        if one.n >= SAMPLES_A_COEFFICIENT:
            by, lost = _best(terms, one, shares, len(told))
            error = one.error(by)
        else:
            by, lost, error = shares, len(terms) / len(told), powers[k] * common.error(shares)
        # rows that cancel to less than this are not known to do so
        spread = float(np.sqrt(max(error, SMALLEST_DEVIATION**2 * powers[k])))
        if one.n:
            found[k] = RowPrediction(tuple(terms), by, spread, one.instants, lost)
    return found


def _best(
    terms: Sequence[tuple[int, int]], told: _Told, common: FloatArray, records: int
) -> tuple[FloatArray, float]:
    """Return the shares of a record's row, and how many coefficients they cost it."""
    tried = [(common, len(terms) / records)]
    if records > 1 and told.n >= SAMPLES_A_COEFFICIENT * len(terms):
        tried.append((told.shares(), float(len(terms))))
    return min(tried, key=lambda one: akaike(told.error(one[0]), told.n, one[1]))


@dataclass(frozen=True, eq=False)
class _Told:
    """What n instants of one record, or of all, say of a row's prediction: the triangle of terms and row."""

    triangle: FloatArray
    instants: IntArray
    n: int
    floor: float

    @staticmethod
    def of(row: int, terms: Sequence[tuple[int, int]], record: RowResiduals) -> _Told:
        instants = np.flatnonzero(_complete([*terms, (row, 0)], record.reach))
        y = record.series[row, instants]
        X = np.stack([record.series[other, instants - lag] for other, lag in terms])
        floor = record.least[row] ** 2 + LEAST_POWER * float(y @ y) / max(len(y), 1)
        return _Told(tall_triangle(X.T, y)[:, 1:], instants, len(y), floor)

    @staticmethod
    def joined(parts: Sequence[_Told], powers: Sequence[float]) -> _Told:
        """Return what all records say, each over the power of its row; one alone as it is."""
        if len(parts) == 1:
            return parts[0]
        n = sum(one.n for one in parts)
        floor = sum(one.n * one.floor / power for one, power in zip(parts, powers, strict=True)) / n
        scaled = [one.triangle / np.sqrt(power) for one, power in zip(parts, powers, strict=True)]
        return _Told(triangle_of(np.concatenate(scaled)), parts[0].instants, n, floor)

    def shares(self) -> FloatArray:
        """Return the shares of the terms, noise of the floor's size added to them."""
        c = self.triangle.shape[1] - 1
        ridge = np.sqrt(self.n * self.floor) * np.eye(c, c + 1)
        R = triangle_of(np.concatenate([self.triangle, ridge]))
        return np.asarray(np.linalg.lstsq(R[:c, :c], R[:c, c], rcond=None)[0], dtype=float)

    def error(self, shares: FloatArray) -> float:
        """Return the mean square of the errors of prediction with shares, that noise among them."""
        left = self.triangle[:, -1] - self.triangle[:, :-1] @ shares
        return float(left @ left) / self.n + self.floor * (1.0 + float(shares @ shares))


def _complete(terms: Sequence[tuple[int, int]], reach: IntArray) -> BoolArray:
    """Return at which instants all terms of a prediction are there, shape (grid,)."""
    grid = reach.shape[1]
    there = np.ones(grid, dtype=bool)
    for other in dict.fromkeys(row for row, _ in terms):
        lags = [lag for row, lag in terms if row == other]
        first, last = min(lags), max(lags)
        # so many samples without a gap end at the latest of them
        enough = reach[other] > last - first
        shifted = np.zeros(grid, dtype=bool)
        if first >= 0:
            shifted[first:] = enough[: grid - first]
        else:
            shifted[:first] = enough[-first:]
        there &= shifted
    return there
