"""The triangle of a QR factorisation, without its Q."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def triangle_of(matrix: FloatArray) -> FloatArray:
    """Return R of matrix = Q R, shape (..., c, c), with lines of zeros where the matrix has fewer than c."""
    R = np.asarray(np.linalg.qr(matrix, mode="r"), dtype=float)
    missing = R.shape[-1] - R.shape[-2]
    if missing <= 0:
        return R
    return np.concatenate([R, np.zeros((*R.shape[:-2], missing, R.shape[-1]))], axis=-2)
