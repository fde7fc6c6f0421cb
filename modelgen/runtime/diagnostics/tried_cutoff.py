"""What least squares at one cut-off predicts of an estimate, and how far it moves from another cut-off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import CERTAIN_MOVE, FULLY_KNOWN, MOST_BIAS
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance


@dataclass(frozen=True, eq=False)
class Tried:
    """What least squares at one cut-off predicts of the method that is to follow.

    Attributes
    ----------
    choice : FilterChoice
    columns : tuple of str
    x, size : array, shape (c,)
        The estimate, without the bias by noise if the method has none; and how large it is.
    square_error : array, shape (c,)
        Variance, and the bias by noise squared if the method has it; infinite where noise is nearly all.
    bias : array, shape (c,)
        The latter, 0 if the method has none.
    influence : sequence of array
        What the stretches of each record contribute to the estimate, shape (stretches, c) each.
    noisy : bool
        Whether noise of the sensors pulls least squares by more than a tenth of any value.
    left : float
        The largest share of its largest term that a row without a force leaves.
    calm : float
        The least share of its record that a row with a force keeps of an arm, if turns are to be left out.
    """

    choice: FilterChoice
    columns: tuple[str, ...]
    x: FloatArray
    size: FloatArray
    square_error: FloatArray
    bias: FloatArray
    influence: Sequence[FloatArray]
    noisy: bool
    left: float
    calm: float

    def digits(self, size: FloatArray, moved: FloatArray | float = 0.0) -> float:
        """Return how many digits of all parameters the method is predicted to determine.

        `size`, shape (c,), is what errors are compared with; `moved`, shape (c,), further square errors.
        """
        share = np.sqrt(self.square_error + moved) / np.maximum(size, np.finfo(float).tiny)
        return float(np.sum(-np.log10(np.clip(share, FULLY_KNOWN, 1.0))))

    def moved_from(self, other: Tried) -> FloatArray:
        """Return the square of the move from another cut-off, less what noise may move, shape (c,).

        Both hold much of the same noise: what it moves is the difference of their influences. The rest is
        dynamics that the model lacks, or noise that is not what it seems.
        """
        apart = [here - there for here, there in zip(self.influence, other.influence, strict=True)]
        noise = np.diag(long_run_covariance(apart)) + self.bias**2 + other.bias**2
        known = np.isfinite(self.square_error) & np.isfinite(other.square_error)
        beyond = (self.x - other.x) ** 2 - CERTAIN_MOVE**2 * noise
        return np.where(known, np.maximum(beyond, 0.0), 0.0)

    @property
    def pulled(self) -> bool:
        """Whether bias by noise, which no interval holds, is more than a small part of an error."""
        square = self.bias**2
        return bool(np.any(square > MOST_BIAS**2 * (self.square_error - square)))
