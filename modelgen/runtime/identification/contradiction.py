"""Where two estimates of the same columns differ by more than noise explains."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.thresholds import DISAGREEMENT
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance


def contradiction(fit: Fit, other: Fit) -> FloatArray:
    """Return by how much two fits to the same columns differ where noise does not explain it, else 0, (c,).

    What one of them hardly determines (friction of two bodies that a simulation moves as one) is no
    contradiction.
    """
    move = fit.solution.x - other.solution.x
    variance = np.diag(hac_covariance(fit)) + np.diag(hac_covariance(other))
    return np.where(np.abs(move) > DISAGREEMENT * np.sqrt(np.maximum(variance, 0.0)), move, 0.0)
