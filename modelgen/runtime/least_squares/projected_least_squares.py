"""Two-stage least squares: the instrumental-variable estimate in the form of a least-squares fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.orthogonal_solution import polished
from modelgen.runtime.least_squares.thresholds import SIMULATED_TOLERANCE
from modelgen.runtime.numerics.qr_triangle import lines_of, tall_triangle, triangle_of


def two_stage(fit: Fit, Z: tuple[FloatArray, ...]) -> Fit:
    """Return the fit of the same weighted rows with instruments Z, shape (n, columns) a block.

    Regressing Y on the projection Z P, P = (Z^T Z)^-1 Z^T W, gives X = (Z^T W)^-1 Z^T Y and keeps everything
    symmetric (Theil 1953); residuals are those of W.
    """
    fit, c = fit.dense(), len(fit.columns)
    # all that the projection and the solution ask of the rows stands in the triangle of [Z W Y]
    parts = [
        weight * lines_of(tall_triangle(np.hstack([z, block.W]), block.Y)[:, 1:])
        for weight, z, block in zip(fit.weights, Z, fit.blocks, strict=True)
    ]
    triangle = triangle_of(np.concatenate(parts))
    scale = np.linalg.norm(triangle[:, :c], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    rank = float(np.finfo(float).eps) * sum(len(z) for z in Z)
    P = np.linalg.lstsq(triangle[:, :c] / scale, triangle[:, c:-1], rcond=rank)[0] / scale[:, None]
    seen = triangle_of(np.column_stack([triangle[:, :c] @ P, triangle[:, -1]]))
    # columns in lines, as those of W are
    return _regressed(fit, tuple((P.T @ z.T).T for z in Z), seen)


def with_regressors(fit: Fit, projected: tuple[FloatArray, ...]) -> Fit:
    """Return the fit of the same weighted rows whose Y is regressed on `projected`, in place of W.

    Its arrays have the shape (n, columns), one a block.
    """
    parts = [
        weight * lines_of(tall_triangle(part, block.Y)[:, 1:])
        for weight, part, block in zip(fit.weights, projected, fit.blocks, strict=True)
    ]
    return _regressed(fit, projected, triangle_of(np.concatenate(parts)))


def _regressed(fit: Fit, projected: tuple[FloatArray, ...], triangle: FloatArray) -> Fit:
    """Return the same, given the triangle of the weighted [projected Y], shape (c + 1, c + 1)."""
    parts = zip(fit.weights, projected, fit.blocks, strict=True)
    weighted = [(weight * part, weight * block.Y) for weight, part, block in parts]
    solution = polished(triangle, weighted, SIMULATED_TOLERANCE)
    residuals = tuple(block.residual(solution.x) for block in fit.blocks)
    return replace(fit, solution=solution, residuals=residuals, projected=projected, series=None)
