"""Rows of records made white together: each predicted from its own past and from rows that share its noise.

Noise of one encoder is in the rows of all bodies that its links touch, in each behind other derivatives. Rows
that are weighed one by one count it several times; what the others of the same instant and before say of it
is taken off. Where those are masked, a row's own past serves (`whitening`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.row_prediction import (
    RowPrediction,
    RowResiduals,
    on_grid,
    predictions,
)
from modelgen.runtime.least_squares.thresholds import (
    LAGS_LOOKED_AT,
    LEAST_RELATED,
    MOST_RELATED,
)
from modelgen.runtime.least_squares.whitening import Whitener, whiteners
from modelgen.runtime.numerics.regressor import Regressors

# Samples that are predicted at a time: they stay in the processor's cache.
PART = 1 << 12


@dataclass(frozen=True, eq=False)
class JointWhitener:
    """Makes what stands in the rows of one record white: one array a row, shape (n, m) each."""

    places: tuple[IntArray, ...]
    alone: tuple[Whitener, ...]
    together: tuple[RowPrediction | None, ...]
    floors: tuple[float, ...]

    @property
    def lost(self) -> float:
        """Coefficients that were estimated; of those for several records its part."""
        return sum((one or white).lost for white, one in zip(self.alone, self.together, strict=True))

    def __call__(self, samples: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        """Return samples at the rows' places with the residuals' colour taken off."""
        return tuple(self._row(row, samples) for row in range(len(self.together)))

    def columns(
        self, samples: Sequence[FloatArray], places: Sequence[IntArray]
    ) -> list[tuple[FloatArray, IntArray]]:
        """Return the same of rows that have some of all columns each, at `places`, in their order.

        `samples`, in any unit, and `places` hold an array a row, (n, k) and (k,); rows returned are alike.
        A row that is predicted from others has their columns as well.
        """
        found = []
        moved = [bool(part.any()) for part in samples]
        for row, one in enumerate(self.together):
            others = {row} if one is None else {row, *(other for other, _ in one.terms)}
            every = np.unique(np.concatenate([places[other] for other in sorted(others)]))
            if not any(moved[other] for other in others):  # what moves one body is in few rows
                found.append((np.zeros((len(samples[row]), len(every))), every))
                continue
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
        for begin in range(0, len(one.instants), PART):
            instants = one.instants[begin : begin + PART]
            own = self._rows(row, instants)
            left = samples[row].T[..., own].copy()
            for (other, lag), share in zip(one.terms, one.shares.tolist(), strict=True):
                left -= share * samples[other].T[..., self._rows(other, instants - lag)]
            white.T[..., own] = left / one.spread

    def _rows(self, row: int, instants: IntArray) -> slice | IntArray:
        """Return which samples of a row are those of some instants, shape (n,) in rising order."""
        start, count = int(np.searchsorted(self.places[row], instants[0])), len(instants)
        if instants[-1] - instants[0] == count - 1:
            return slice(start, start + count)
        return np.searchsorted(self.places[row], instants)


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """Makes what stands in the rows of a fit white; `parts` are each record's blocks and whitener."""

    parts: tuple[tuple[tuple[int, ...], JointWhitener], ...]

    @property
    def lost(self) -> int:
        """Coefficients that were estimated."""
        return round(sum(white_of.lost for _, white_of in self.parts))

    def columns(
        self, samples: Sequence[FloatArray], places: Sequence[IntArray]
    ) -> list[tuple[FloatArray, IntArray]]:
        """Return samples with the residuals' colour taken off, and which columns those of each block are.

        Parameters
        ----------
        samples : sequence of array
            Of every block, in any unit, shape (n, k) each.
        places : sequence of array
            Which of all columns these are, shape (k,) each, in their order; the others are zero.
        """
        found = [(samples[0], places[0])] * len(samples)
        for ours, white_of in self.parts:
            own, at = [samples[index] for index in ours], [places[index] for index in ours]
            for index, white in zip(ours, white_of.columns(own, at), strict=True):
                found[index] = white
        return found


@dataclass(frozen=True, eq=False)
class WhiteFit:
    """What makes rows white, what white Y is regressed on, and the inverse of its products."""

    rows: WhiteRows
    regressors: Regressors
    inverse: FloatArray

    def moved(self, change: Sequence[FloatArray]) -> FloatArray:
        """Return what X grows by, shape (columns,), when Y grows: an array a block, (n,), both in SI."""
        only = np.zeros(1, dtype=np.int64)
        white = self.rows.columns([part[:, None] for part in change], [only] * len(change))
        across = sum(one.across(part[:, 0]) for one, (part, _) in zip(self.regressors, white, strict=True))
        return np.asarray(self.inverse @ across)


def joint_whiteners(records: Sequence[RowResiduals], rises: Sequence[int]) -> tuple[JointWhitener, ...]:
    """Return the whitener of each record of some that share the noise of their sensors.

    `rises` says how often each row is differentiated.
    """
    rows = range(len(rises))
    alone = [
        whiteners([one.residuals[r] for one in records], [one.places[r] for one in records]) for r in rows
    ]
    own = [tuple(white[k] for white in alone) for k in range(len(records))]
    related = _related(
        [
            on_grid(
                [w(e, p) for w, e, p in zip(own[k], one.residuals, one.places, strict=True)],
                one.places,
                one.grid,
            )
            for k, one in enumerate(records)
        ]
    )
    together = [
        predictions(row, related[row], rises, records, [_power(one) for one in alone[row]]) for row in rows
    ]
    return tuple(
        JointWhitener(
            one.places,
            own[k],
            tuple(found[k] for found in together),
            tuple(_floor(w, size) for w, size in zip(own[k], one.least, strict=True)),
        )
        for k, one in enumerate(records)
    )


def _floor(white: Whitener, least: float) -> float:
    """Return by how much white rows shrink when noise of the least size is added."""
    power = _power(white)
    return float(np.sqrt(power / (power + least**2)))


def _power(white: Whitener) -> float:
    return max(white.variances[-1], float(np.finfo(float).tiny))


def _related(white: Sequence[FloatArray]) -> list[list[int]]:
    """Return for each row the others with which its residual goes together, own colours taken off.

    `white` are the residuals of each record on its grid, shape (rows, grid).
    """
    norms = np.sqrt(np.sum([np.sum(series**2, axis=1) for series in white], axis=0))
    norms = np.maximum(norms, np.finfo(float).tiny)[:, None]
    most = np.zeros((len(norms), len(norms)))
    for lag in range(LAGS_LOOKED_AT + 1):
        products = [series[:, lag:] @ series[:, : series.shape[1] - lag].T for series in white]
        found = np.abs(np.sum(products, axis=0)) / norms / norms.T
        most = np.maximum(most, np.maximum(found, found.T))
    np.fill_diagonal(most, 0.0)
    chosen = []
    for line in most:
        best = np.argsort(-line, kind="stable")[:MOST_RELATED]
        chosen.append(sorted(int(other) for other in best if line[other] > LEAST_RELATED))
    return chosen
