"""Two-stage least squares: the instrumental-variable estimate in the form of a least-squares fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit, regressed_rows, residuals_of
from modelgen.runtime.least_squares.orthogonal_solution import inverse_of, polished
from modelgen.runtime.least_squares.thresholds import ALIKE, SIMULATED_TOLERANCE
from modelgen.runtime.numerics.qr_triangle import joined_triangle, lines_of, tall_triangle, triangle_of
from modelgen.runtime.numerics.regressor import Regressor, Regressors, WeightedPieces


def two_stage(fit: Fit, Z: Regressors | tuple[FloatArray, ...]) -> Fit:
    """Return the fit of the same weighted rows with instruments Z.

    Regressing Y on the projection Z P, P = (Z^T Z)^-1 Z^T W, gives X = (Z^T W)^-1 Z^T Y and keeps everything
    symmetric (Theil 1953); residuals are those of W.

    Parameters
    ----------
    fit : Fit
    Z : Regressors, or tuple of array
        One for each column; arrays, in SI, are those of the columns that each block has, (n, k).
    """
    c = len(fit.columns)
    if not isinstance(Z, Regressors):
        Z = Regressors(tuple(Z), tuple(block.touched for block in fit.blocks), None, c)
    # all that the projection and the solution ask of the rows stands in the triangle of [Z W Y]
    parts = []
    for weight, z, block in zip(fit.weights, Z, fit.blocks, strict=True):
        lines = weight * lines_of(tall_triangle((z.samples, block.W), block.Y)[:, 1:])
        k, W = z.samples.shape[1], Regressor(block.W, block.touched, None, c)
        parts.append(np.column_stack([z.lines(lines[:, :k]), W.lines(lines[:, k:-1]), lines[:, -1]]))
    triangle = joined_triangle(parts)
    scale = np.linalg.norm(triangle[:c, :c], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    rank = float(np.finfo(float).eps) * sum(len(z) for z in Z.samples)
    inner = inverse_of(triangle[:c, :c] / scale, rank)
    P = inner.inverse @ triangle[:c, c:-1] / scale[:, None]
    # what lies along the instruments, and below it the norm of what of Y does not
    along = triangle[:c, c:].copy()
    if len(inner.null):
        along[:, :-1] = triangle[:c, :c] @ P
    beyond = np.zeros(c + 1)
    beyond[-1] = np.linalg.norm(triangle[c:, -1])
    seen = triangle_of(np.vstack([along, beyond]))
    return _regressed(fit, Z.mixed(P), seen)


def with_regressors(fit: Fit, projected: Regressors) -> Fit:
    """Return the fit of the same weighted rows whose Y is regressed on `projected`, in place of W."""
    return _regressed(fit, projected, joined_triangle(regressed_rows(fit.blocks, fit.weights, projected)))


def _regressed(fit: Fit, projected: Regressors, triangle: FloatArray) -> Fit:
    """Return the same, given the triangle of the weighted [projected Y], shape (c + 1, c + 1)."""
    parts = WeightedPieces(projected, tuple(block.Y for block in fit.blocks), fit.weights)
    solution = polished(triangle, parts, SIMULATED_TOLERANCE, ALIKE)
    residuals = residuals_of(fit.blocks, solution.x)
    own = replace(fit, series=None, white=None)
    return replace(own, solution=solution, residuals=residuals, projected=projected)
