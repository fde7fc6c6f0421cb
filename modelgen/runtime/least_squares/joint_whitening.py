"""Rows of a record made white together: each predicted from its own past and from rows that share its noise.

Noise of one encoder is in the rows of all bodies that its links touch, in each behind other derivatives. Rows
that are weighed one by one count it several times; what the others of the same instant and before say of it
is taken off. Where those are masked, a row's own past serves (`whitening`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.least_squares.thresholds import (
    JOINT_ORDER,
    LAGS_LOOKED_AT,
    LEAST_POWER,
    LEAST_RELATED,
    MOST_RELATED,
    SAMPLES_A_COEFFICIENT,
    SMALLEST_DEVIATION,
)
from modelgen.runtime.least_squares.whitening import Whitener, whitener
from modelgen.runtime.numerics.qr_triangle import tall_triangle, triangle_of
from modelgen.runtime.rows.row_block import runs_of

# Samples that are predicted at a time: they stay in the processor's cache.
PART = 1 << 12


@dataclass(frozen=True, eq=False)
class RowPrediction:
    """How a row follows from `terms`, pairs (row, lag), at instants of the grid; `spread` is its error's."""

    terms: tuple[tuple[int, int], ...]
    shares: FloatArray
    spread: float
    instants: IntArray


@dataclass(frozen=True, eq=False)
class JointWhitener:
    """Makes what stands in the rows of one record white: one array a row, shape (n, m) each."""

    places: tuple[IntArray, ...]
    alone: tuple[Whitener, ...]
    together: tuple[RowPrediction | None, ...]
    floors: tuple[float, ...]

    @property
    def lost(self) -> int:
        """Coefficients that were estimated."""
        own = [white.order for white in self.alone]
        both = [0 if one is None else len(one.terms) for one in self.together]
        return sum(max(pair) for pair in zip(own, both, strict=True))

    def __call__(self, samples: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        """Return samples at the rows' places with the residuals' colour taken off."""
        return tuple(self._row(row, samples) for row in range(len(self.together)))

    def columns(
        self, samples: Sequence[FloatArray], places: Sequence[IntArray]
    ) -> list[tuple[FloatArray, IntArray]]:
        """Return the same of rows that have some of all columns each, at `places`, in their order.

        `samples` and `places` hold an array a row, shape (n, k) and (k,); the rows returned are alike.
        A row that is predicted from others has their columns as well.
        """
        found = []
        for row, one in enumerate(self.together):
            others = {row} if one is None else {row, *(other for other, _ in one.terms)}
            every = np.unique(np.concatenate([places[other] for other in sorted(others)]))
            wide = list(samples)
            for other in others:
                if len(every) > len(places[other]):
                    lines = np.zeros((len(every), len(samples[other])))
                    lines[np.searchsorted(every, places[other])] = samples[other].T
                    wide[other] = lines.T
            found.append((self._row(row, wide), every))
        return found

    def _row(self, row: int, samples: Sequence[FloatArray]) -> FloatArray:
        white, one = np.empty_like(samples[row]), self.together[row]
        self._predict_alone(white, row, samples[row])
        if one is not None:
            self._predict(white, row, one, samples)
        return white

    def _predict_alone(self, white: FloatArray, row: int, samples: FloatArray) -> None:
        """Fill in what no others say anything of."""
        place, alone, one = self.places[row], self.alone[row], self.together[row]
        if one is None:
            white[:] = self.floors[row] * alone(samples, place)
            return
        left = np.ones(len(place), dtype=bool)
        left[np.searchsorted(place, one.instants)] = False
        # with those before them that they are predicted from
        needed = left.copy()
        for lag in range(1, alone.order + 1):
            needed[:-lag] |= left[lag:]
        found = np.flatnonzero(needed)
        if found.size:
            kept = left[found]
            white[found[kept]] = self.floors[row] * alone(samples[found], place[found])[kept]

    def _predict(
        self, white: FloatArray, row: int, one: RowPrediction, samples: Sequence[FloatArray]
    ) -> None:
        for run in runs_of(one.instants):
            for begin in range(0, len(run), PART):
                first = int(one.instants[run[begin]])
                count = min(PART, len(run) - begin)
                left = samples[row][self._rows(row, first, count)].copy(order="K")
                for (other, lag), share in zip(one.terms, one.shares.tolist(), strict=True):
                    left -= share * samples[other][self._rows(other, first - lag, count)]
                white[self._rows(row, first, count)] = left / one.spread

    def _rows(self, row: int, instant: int, count: int) -> slice:
        start = int(np.searchsorted(self.places[row], instant))
        return slice(start, start + count)


def joint_whitener(
    residuals: Sequence[FloatArray],
    places: Sequence[IntArray],
    grid: int,
    least: Sequence[float],
    rises: Sequence[int],
) -> JointWhitener:
    """Return the whitener of the residuals of a record's rows, shape (n,) each, at places of its grid.

    `least` is the rms below which a row's residual says nothing: white noise of that size counts as added.
    `rises` says how often each row is differentiated.
    """
    alone = tuple(whitener(e, place) for e, place in zip(residuals, places, strict=True))
    reach = np.stack([_past(place, grid) for place in places])
    series = np.zeros((len(places), grid))
    for line, e, place in zip(series, residuals, places, strict=True):
        line[place] = e
    related = _related(
        [white(e, p) for white, e, p in zip(alone, residuals, places, strict=True)], places, grid
    )
    own = [max(one.variances[-1], float(np.finfo(float).tiny)) for one in alone]
    together = []
    for row, variance in enumerate(own):
        one = _prediction(row, related[row], rises, series, reach, least[row])
        # rows that cancel to less than this are not known to do so
        smallest = SMALLEST_DEVIATION * float(np.sqrt(variance))
        together.append(one and replace(one, spread=max(one.spread, smallest)))
    floors = tuple(float(np.sqrt(one / (one + size**2))) for one, size in zip(own, least, strict=True))
    return JointWhitener(tuple(places), alone, tuple(together), floors)


def _past(place: IntArray, grid: int) -> IntArray:
    """Return how many samples without a gap end at each instant, shape (grid,)."""
    instants = np.arange(grid)
    missing = np.ones(grid, dtype=bool)
    missing[place] = False
    return np.asarray(instants - np.maximum.accumulate(np.where(missing, instants, -1)))


def _related(white: Sequence[FloatArray], places: Sequence[IntArray], grid: int) -> list[list[int]]:
    """Return for each row the others with which its residual goes together, own colours taken off."""
    series = np.zeros((len(places), grid), dtype=float)
    for line, e, place in zip(series, white, places, strict=True):
        line[place] = e / max(float(np.linalg.norm(e)), float(np.finfo(float).tiny))
    most = np.zeros((len(places), len(places)))
    for lag in range(LAGS_LOOKED_AT + 1):
        found = np.abs(series[:, lag:] @ series[:, : grid - lag].T)
        most = np.maximum(most, np.maximum(found, found.T))
    np.fill_diagonal(most, 0.0)
    chosen = []
    for line in most:
        best = np.argsort(-line, kind="stable")[:MOST_RELATED]
        chosen.append(sorted(int(other) for other in best if line[other] > LEAST_RELATED))
    return chosen


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


def _prediction(
    row: int, related: Sequence[int], rises: Sequence[int], series: FloatArray, reach: IntArray, least: float
) -> RowPrediction | None:
    """Return how a row follows from itself and related rows; None where too few samples say that."""
    share = len(_terms(row, related, rises, JOINT_ORDER)) / JOINT_ORDER
    order = min(JOINT_ORDER, int(np.sum(reach[row] > 0) / (SAMPLES_A_COEFFICIENT * share)))
    terms = _terms(row, related, rises, order)
    if order < 1 or all(other == row for other, _ in terms):
        return None
    instants = np.flatnonzero(_complete([*terms, (row, 0)], reach))
    if len(instants) < SAMPLES_A_COEFFICIENT * len(terms):
        return None
    y = series[row, instants]
    X = np.stack([series[other, instants - lag] for other, lag in terms])
    triangle = tall_triangle(X.T, y)[:, 1:]
    c, n = len(terms), len(instants)
    floor = least**2 + LEAST_POWER * float(y @ y) / n
    ridge = np.sqrt(n * floor) * np.eye(c, c + 1)
    R = triangle_of(np.concatenate([triangle, ridge]))
    shares = np.asarray(np.linalg.lstsq(R[:c, :c], R[:c, c], rcond=None)[0], dtype=float)
    return RowPrediction(tuple(terms), shares, float(np.sqrt(R[c, c] ** 2 / n + floor)), instants)


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
