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

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.thresholds import LEAST_POWER, SAMPLES_A_COEFFICIENT, WHITENING_ORDER
from modelgen.runtime.rows.row_block import runs_of


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
        order = self.order
        white = np.empty(samples.shape)
        for run in runs_of(place):
            x = samples[run]
            y = x.copy()
            for known in range(1, min(order, len(x))):
                y[known] -= self.predictors[known] @ x[known - 1 :: -1][:known]
            if len(x) > order:
                for lag, share in enumerate(self.predictors[order], start=1):
                    y[order:] -= share * x[order - lag : len(x) - lag]
            spread = np.sqrt(np.full(len(x), self.variances[order]))
            spread[:order] = np.sqrt(self.variances[: min(order, len(x))])
            white[run] = (y.T / spread).T
        return white


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
    stretches = [e[run] for e, place in zip(residuals, places, strict=True) for run in runs_of(place)]
    longest, count = max(len(one) for one in stretches), sum(len(e) for e in residuals)
    order = max(0, min(most, count // SAMPLES_A_COEFFICIENT, longest - 1))
    power = sum(float(e @ e) for e in residuals)
    power = max((1.0 + LEAST_POWER) * power, float(np.finfo(float).tiny))
    predictor, variance = np.zeros(0), power
    predictors, variances = [predictor], [variance]
    # errors of prediction forward and of the sample before backward, a pair of series for every stretch
    errors = [(one[1:], one[:-1]) for one in stretches]
    for _ in range(order):
        reflection = _reflection(errors, LEAST_POWER * power)
        errors = [((f - reflection * b)[1:], (b - reflection * f)[:-1]) for f, b in errors]
        predictor = np.append(predictor - reflection * predictor[::-1], reflection)
        variance *= 1.0 - reflection**2
        predictors.append(predictor)
        variances.append(variance)
    return Whitener(tuple(predictors), tuple(v / count for v in variances), len(residuals))


def _reflection(errors: Sequence[tuple[FloatArray, FloatArray]], least: float) -> float:
    """Return the coefficient that makes both errors of all stretches together smallest; less than 1."""
    product = sum(float(f @ b) for f, b in errors)
    return 2.0 * product / (sum(float(f @ f + b @ b) for f, b in errors) + least)
