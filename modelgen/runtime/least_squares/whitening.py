"""Rows made white: an autoregression of the residual, taken off rows and instruments alike.

Noise of a position, differentiated four times, lies at the upper end of the band: rows weighted by one number
each then waste what the lower end tells. A causal filter that makes the residual white weighs every frequency
by its own noise; as it goes over both sides of the rows, nothing is biased by it.

Records of one row share the noise of their sensors, and short ones say little of it each: one autoregression
is taken from all of them, and a record's own only where that is expected to foretell more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.block_numpy import product
from modelgen.runtime.least_squares.thresholds import LEAST_POWER, SAMPLES_A_COEFFICIENT, WHITENING_ORDER
from modelgen.runtime.rows.row_block import run_edges

# Samples that are foretold by one product, and by so many at a time, which stay in the processor's cache.
BLOCK, PART = 64, 1 << 12


@dataclass(frozen=True, eq=False)
class Whitener:
    """Predictors of every order up to the last one of a residual, and the variances of their errors.

    `records` is the number of records that they are taken from together.
    """

    predictors: tuple[FloatArray, ...]
    variances: tuple[float, ...]
    records: int = 1

    @property
    def order(self) -> int:
        """The order of the autoregression."""
        return len(self.predictors) - 1

    @property
    def lost(self) -> float:
        """Coefficients that were estimated; of those for several records its part."""
        return self.order / self.records

    def __call__(self, samples: FloatArray, place: IntArray) -> FloatArray:
        """Return samples at places of a grid, shape (n,) or (n, c), with the residual's colour taken off.

        The first samples after a gap are predicted from the fewer that there are.
        """
        order, white, roots = self.order, np.empty(samples.shape), np.sqrt(self.variances)
        for begin in range(order, len(samples), PART):
            part = slice(begin, begin + PART)
            white[part] = samples[part] - self._foretold(samples[begin - order : begin + PART])
            white[part] /= roots[order]
        if not order or not len(samples):
            return white
        edges = run_edges(place)
        starts, lengths = edges[:-1], np.diff(edges)
        # the first samples of all runs together: each is predicted from those before it
        first = np.arange(order)
        at = np.minimum(starts[:, None] + first, len(samples) - 1)
        x = samples[at].reshape(*at.shape, -1)
        begun = (x - self._begun @ x) / roots[:order, None]
        held = first < lengths[:, None]
        white[at[held]] = begun[held].reshape(-1, *samples.shape[1:])
        return white

    @cached_property
    def _begun(self) -> FloatArray:
        """What the first samples are predicted from, those before each of them, shape (order, order)."""
        found = np.zeros((self.order, self.order))
        for known in range(1, self.order):
            found[known, :known] = self.predictors[known][::-1]
        return found

    @cached_property
    def _table(self) -> FloatArray:
        """What a block and the `order` samples before it foretell of it, shape (order + BLOCK, BLOCK)."""
        found, place = np.zeros((self.order + BLOCK, BLOCK)), np.arange(BLOCK)
        found[np.arange(self.order)[:, None] + place, place] = self.predictors[self.order][::-1, None]
        return found

    def _foretold(self, x: FloatArray) -> FloatArray:
        """Return what is predicted of samples, shape (n, ...), from the `order`-th on, (n - order, ...).

        Block by block: a product of few matrices takes a fifth of the time of a sum over lags.
        """
        count, wide = len(x) - self.order, len(self._table)
        lines = x.reshape(len(x), -1).T
        blocks, step = -(-count // BLOCK), lines.itemsize
        padded = np.zeros((len(lines), blocks * BLOCK + self.order))
        padded[:, : len(x)] = lines
        strides = (padded.strides[0], BLOCK * step, step)
        # lines that overlap are no matrix
        windows = np.ndarray((len(lines), blocks, wide), float, padded, strides=strides).copy()
        found = product(windows.reshape(-1, wide), self._table).reshape(len(lines), -1)
        return found[:, :count].T.reshape(count, *x.shape[1:])


def whiteners(
    residuals: Sequence[FloatArray], places: Sequence[IntArray], most: int = WHITENING_ORDER
) -> tuple[Whitener, ...]:
    """Return the whitener of each record's residual of one row, in its unit, (n,) each, at places of a grid.

    That of all records, at each one's own size, unless the record's own is expected to foretell more.
    """
    own = tuple(whitener([e], [place], most) for e, place in zip(residuals, places, strict=True))
    if len(own) == 1:
        return own
    # each counts by its instants, loud or not
    common = whitener([e / size for e, size in zip(residuals, _sizes(residuals), strict=True)], places, most)
    return tuple(_better(*each, common) for each in zip(own, residuals, places, strict=True))


def _sizes(residuals: Sequence[FloatArray]) -> list[float]:
    """Return the rms of each residual, shape (n,); 1 where it is silent."""
    return [float(np.sqrt(e @ e / max(len(e), 1))) or 1.0 for e in residuals]


def _better(own: Whitener, residual: FloatArray, place: IntArray, common: Whitener) -> Whitener:
    """Return the whitener of all records at the size of one, or the record's own."""
    n, white = len(residual), common(residual, place)
    share = max(float(white @ white) / n, own.variances[-1] / common.variances[-1])
    ours = akaike(own.variances[-1], n, own.lost)
    if ours < akaike(share * common.variances[-1], n, common.lost):
        return own
    return replace(common, variances=tuple(share * one for one in common.variances))


def akaike(error: float, n: int, coefficients: float) -> float:
    """Return n times the logarithm of what predictions of n fresh instants would leave (Akaike 1974).

    `error` is the mean square of the errors of prediction of n instants, which the coefficients, or that part
    of them, were estimated from.
    """
    return n * float(np.log(max(error, np.finfo(float).tiny))) + 2.0 * coefficients


def whitener(
    residuals: Sequence[FloatArray], places: Sequence[IntArray], most: int = WHITENING_ORDER
) -> Whitener:
    """Return one whitener of residuals, in any unit, (n,) each, at places of grids, of that order at most.

    Burg's method over all stretches together (de Waele and Broersen 2000): sums of products would lose the
    more at every lag, the shorter the stretches are, and leave colour where reversals cut a record to pieces.
    """
    lengths = np.concatenate([np.diff(run_edges(place)) for place in places])
    longest, count = int(lengths.max()), sum(len(e) for e in residuals)
    order = max(0, min(most, count // SAMPLES_A_COEFFICIENT, longest - 1))
    power = sum(float(e @ e) for e in residuals)
    power = max((1.0 + LEAST_POWER) * power, float(np.finfo(float).tiny))
    predictor, variance = np.zeros(0), power
    predictors, variances = [predictor], [variance]
    # errors of prediction forward, and of the sample before backward; all stretches one after the other, with
    # zeros where too few samples of a stretch lie before
    forward = backward = np.concatenate(residuals)
    starts = np.cumsum(lengths)[:-1]
    for known in range(1, order + 1):
        forward, backward = forward[1:], backward[:-1]
        if starts.size:
            if known == 1:
                forward, backward = forward.copy(), backward.copy()
            forward[starts[starts <= len(forward)] - 1] = 0.0
            first = starts - known
            backward[first[(first >= 0) & (first < len(backward))]] = 0.0
        crossed = float(forward @ backward)
        both = float(forward @ forward + backward @ backward)
        reflection = 2.0 * crossed / (both + LEAST_POWER * power)
        forward, backward = forward - reflection * backward, backward - reflection * forward
        longer = np.empty(known)
        longer[:-1], longer[-1] = predictor - reflection * predictor[::-1], reflection
        predictor = longer
        variance *= 1.0 - reflection**2
        predictors.append(predictor)
        variances.append(variance)
    return Whitener(tuple(predictors), tuple(v / count for v in variances), len(residuals))
