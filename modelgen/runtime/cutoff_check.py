"""How far the estimate moves with the cut-off: what noise in the sensors and missing dynamics do to it.

With a right model and clean sensors the matched filter cancels, and no cut-off changes anything. Noise in the
columns biases least squares and dynamics that the model lacks bend it, both more the higher the cut-off: a
drift that no residual shows. It belongs into an honest interval.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.choose import HIGHEST_CUTOFF, FilterChoice
from modelgen.runtime.wls import Fit

FloatArray = npt.NDArray[np.float64]

# The cut-offs tried, as multiples of the one in use.
FACTORS = (1.0 / sqrt(2.0), sqrt(2.0))


def cutoff_covariance(
    fit: Fit, choice: FilterChoice, lowest_fs: float, again: Callable[[FilterChoice], Fit]
) -> FloatArray:
    """Return the mean square of the moves of X when the cut-off is changed, shape (c, c).

    Parameters
    ----------
    fit : Fit
        The fit at the cut-off in use.
    choice : FilterChoice
        The settings in use; decimation and directions stay.
    lowest_fs : float
        Lowest sampling frequency of the records in Hz: no cut-off above 0.4 of it is tried.
    again : callable
        Observes and fits with other settings.
    """
    moves = []
    for factor in FACTORS:
        cutoff_hz = min(factor * choice.cutoff_hz, HIGHEST_CUTOFF * lowest_fs)
        if factor > 1.0 and cutoff_hz <= choice.cutoff_hz:
            continue
        try:
            other = again(replace(choice, cutoff_hz=cutoff_hz))
        except (DataError, IdentifiabilityError):
            continue  # a lower cut-off reaches farther: the record may be too short for it
        if other.columns == fit.columns:
            moves.append(other.solution.x - fit.solution.x)
    return _mean_square(moves, len(fit.columns))


def _mean_square(moves: Sequence[FloatArray], columns: int) -> FloatArray:
    total = np.zeros((columns, columns))
    for move in moves:
        total += np.outer(move, move) / len(moves)
    return total
