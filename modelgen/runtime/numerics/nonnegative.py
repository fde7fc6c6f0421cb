"""Least squares with no negative coefficient, for a few columns (Lawson and Hanson 1974, chapter 23)."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import BoolArray, FloatArray

# A column whose residual correlates with it by less than this share of both sizes would gain nothing.
LEAST_GAIN = 1e-12


def nonnegative(A: FloatArray, b: FloatArray) -> FloatArray:
    """Return the x with no negative entry that makes the norm of A x - b least, shape (columns,).

    Parameters
    ----------
    A : array, shape (n, columns)
        The columns should be of comparable size.
    b : array, shape (n,)
    """
    columns = A.shape[1]
    free, x = np.zeros(columns, dtype=bool), np.zeros(columns)
    size = np.linalg.norm(A, axis=0) * np.linalg.norm(b)
    for _ in range(3 * columns):
        gain = np.where(free, 0.0, A.T @ (b - A @ x))
        best = int(np.argmax(gain))
        if gain[best] <= LEAST_GAIN * size[best]:
            break
        free[best] = True
        x = _towards(A, b, x, free)
    return x


def _towards(A: FloatArray, b: FloatArray, x: FloatArray, free: BoolArray) -> FloatArray:
    """Return the solution with the free columns alone; those that it makes negative are freed no more."""
    while free.any():
        there = np.zeros(len(x))
        there[free] = np.linalg.lstsq(A[:, free], b, rcond=None)[0]
        below = free & (there <= 0.0)
        if not below.any():
            return there
        share = float(np.min(x[below] / (x[below] - there[below] + np.finfo(float).tiny)))
        x = x + share * (there - x)
        free &= ~(below & (x <= np.finfo(float).eps * np.max(x, initial=0.0)))
        x[~free] = 0.0
    return np.zeros(len(x))
