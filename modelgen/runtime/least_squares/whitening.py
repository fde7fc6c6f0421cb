"""Rows made white: an autoregression of the residual, taken off rows and instruments alike.

Noise of a position, differentiated four times, lies at the upper end of the band: rows weighted by one number
each then waste what the lower end tells. A causal filter that makes the residual white weighs every frequency
by its own noise; as it goes over both sides of the rows, nothing is biased by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.thresholds import LEAST_POWER, SAMPLES_A_COEFFICIENT, WHITENING_ORDER
from modelgen.runtime.rows.row_block import runs_of


@dataclass(frozen=True, eq=False)
class Whitener:
    """Predictors of every order up to the last one of a residual, and the variances of their errors."""

    predictors: tuple[FloatArray, ...]
    variances: tuple[float, ...]

    @property
    def order(self) -> int:
        """The order of the autoregression."""
        return len(self.predictors) - 1

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


def whitener(residual: FloatArray, place: IntArray, most: int = WHITENING_ORDER) -> Whitener:
    """Return the whitener of a residual, shape (n,), at places of a grid, of that order at most.

    Burg's method over all stretches together (de Waele and Broersen 2000): sums of products would lose the
    more at every lag, the shorter the stretches are, and leave colour where reversals cut a record to pieces.
    """
    runs = runs_of(place)
    longest = max(len(run) for run in runs)
    order = max(0, min(most, len(residual) // SAMPLES_A_COEFFICIENT, longest - 1))
    power = max((1.0 + LEAST_POWER) * float(residual @ residual), float(np.finfo(float).tiny))
    predictor, variance = np.zeros(0), power
    predictors, variances = [predictor], [variance]
    # errors of prediction forward and of the sample before backward, a pair of series for every stretch
    errors = [(residual[run][1:], residual[run][:-1]) for run in runs]
    for _ in range(order):
        reflection = _reflection(errors, LEAST_POWER * power)
        errors = [((f - reflection * b)[1:], (b - reflection * f)[:-1]) for f, b in errors]
        predictor = np.append(predictor - reflection * predictor[::-1], reflection)
        variance *= 1.0 - reflection**2
        predictors.append(predictor)
        variances.append(variance)
    return Whitener(tuple(predictors), tuple(v / len(residual) for v in variances))


def _reflection(errors: Sequence[tuple[FloatArray, FloatArray]], least: float) -> float:
    """Return the coefficient that makes both errors of all stretches together smallest; less than 1."""
    product = sum(float(f @ b) for f, b in errors)
    return 2.0 * product / (sum(float(f @ f + b @ b) for f, b in errors) + least)
