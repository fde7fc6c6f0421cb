"""Two-stage least squares: the instrumental-variable estimate in the form of a least-squares fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.orthogonal_solution import least_squares


def two_stage(fit: Fit, Z: tuple[FloatArray, ...]) -> Fit:
    """Return the fit of the same weighted rows with instruments Z, shape (n, columns) a block.

    Regressing Y on the projection Z P, P = (Z^T Z)^-1 Z^T W, gives X = (Z^T W)^-1 Z^T Y and keeps everything
    symmetric (Theil 1953); residuals are those of W.
    """
    fit = fit.dense()
    stacked = np.concatenate([w * z for w, z in zip(fit.weights, Z, strict=True)])
    W = np.concatenate([w * b.W for w, b in zip(fit.weights, fit.blocks, strict=True)])
    scale = np.linalg.norm(stacked, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    P = np.linalg.lstsq(stacked / scale, W, rcond=None)[0] / scale[:, None]
    return with_regressors(fit, tuple(z @ P for z in Z))


def with_regressors(fit: Fit, projected: tuple[FloatArray, ...]) -> Fit:
    """Return the fit of the same weighted rows whose Y is regressed on `projected`, in place of W."""
    R = np.concatenate([w * p for w, p in zip(fit.weights, projected, strict=True)])
    Y = np.concatenate([w * b.Y for w, b in zip(fit.weights, fit.blocks, strict=True)])
    solution = least_squares(R, Y)
    residuals = tuple(block.residual(solution.x) for block in fit.blocks)
    return replace(fit, solution=solution, residuals=residuals, projected=projected)
