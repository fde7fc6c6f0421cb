"""Combinations of correlated numbers that are uncorrelated, with variance 1 each."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray

# Directions with less than this share of the largest power (of columns of even power) are rounding.
LEAST_POWER = 1e-10


def whitening(covariance: FloatArray, smallest: float) -> FloatArray:
    """Return V with V C V^T = 1, shape (n, n), except where C is next to nothing: there V stays bounded.

    Standard deviations in a direction count as at least `smallest` times the largest, after scaling to one.
    """
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    spread = np.where(spread > 0.0, spread, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    floor = smallest**2 * max(float(values[-1]), 1.0)
    return np.asarray((vectors / np.sqrt(np.maximum(values, floor))).T / spread)


def principal_directions(series: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the eigenvalues of S^T S that are not rounding, shape (k,), and their vectors, shape (c, k).

    `series` is S, shape (n, c); of S^T S and S S^T the smaller matrix is taken apart.
    """
    few = len(series) < series.shape[1]
    power, directions = np.linalg.eigh(series @ series.T if few else series.T @ series)
    alive = power > LEAST_POWER * power[-1]
    power, directions = power[alive], directions[:, alive]
    if few:
        directions = series.T @ (directions / np.sqrt(power))
    return power, directions


def square_root(covariance: FloatArray, scale: FloatArray | None = None) -> FloatArray:
    """Return R with R R^T the part of a symmetric matrix that is positive semidefinite, in any units, (c, c).

    Numbers are compared on a scale, shape (c,) in their units, by default their standard deviations; those
    with 0 on it have no part.
    """
    if scale is None:
        scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    apart = np.where(scale > 0.0, scale, np.inf)
    values, vectors = np.linalg.eigh(covariance / np.outer(apart, apart))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
