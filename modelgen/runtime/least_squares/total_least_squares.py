"""Total least squares: noise in the columns as well as in Y; for comparison.

X makes the smallest change of [W Y], on columns of unit length, that makes the rows consistent (Golub and Van
Loan 1980). Columns without noise, constants and directions of motion, are taken out first (Van Huffel and
Vandewalle 1991, ch. 3.5). It is consistent only where noise is as large, relative to every column's length,
in all columns and in Y, and uncorrelated between them: derivatives of one encoder are neither. Instrumental
variables ask for less.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.thresholds import RANK_TOLERANCE
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.regressor import plain_regressors

NOTE = (
    "total least squares takes the noise to be as large, relative to its length, in every column and in Y, "
    "and uncorrelated; derivatives of one sensor are not like that: a comparison, not an estimate to rely on"
)


def fit_total(fit: Fit, model: Model) -> Fit:
    """Return the total least-squares fit to the weighted rows of a least-squares fit.

    Its `inverse` is that of W^T W - s^2 D (D the squared lengths of the noisy columns), with which influence
    and covariances are right to first order.

    Raises
    ------
    IdentifiabilityError
        When the smallest singular value does not belong to Y: there is no solution.
    """
    fit = fit.dense()
    W = np.concatenate([weight * block.W for weight, block in zip(fit.weights, fit.blocks, strict=True)])
    Y = fit.weighted_measurement
    exact = np.array([_exact(model, name) for name in fit.columns])
    scale = np.linalg.norm(W, axis=0)
    y_scale = float(np.linalg.norm(Y)) or 1.0
    noisy = np.flatnonzero(~exact)
    ordered = np.concatenate([np.flatnonzero(exact), noisy])
    triangle = np.asarray(np.linalg.qr(np.column_stack([(W / scale)[:, ordered], Y / y_scale]), mode="r"))
    known = int(exact.sum())
    # below the exact columns: what they do not explain of the noisy ones and of Y
    _, s, Vt = np.linalg.svd(triangle[known:, known:])
    last = Vt[-1]
    apart = len(s) > 1 and s[-2] - s[-1] > RANK_TOLERANCE * s[0]
    if not apart or abs(last[-1]) < RANK_TOLERANCE:
        remedy = "use method wls or iv, which say what cannot be distinguished"
        raise IdentifiabilityError.at("method tls", "has no solution: columns are dependent", remedy)
    free = -last[:-1] / last[-1]
    rest = triangle[:known, -1] - triangle[:known, known:-1] @ free
    fixed = np.linalg.solve(triangle[:known, :known], rest) if known else rest
    x = np.zeros(len(fit.columns))
    x[ordered] = np.concatenate([fixed, free]) * y_scale / scale[ordered]
    normal = triangle[:, :-1].T @ triangle[:, :-1]
    normal[range(known, len(x)), range(known, len(x))] -= s[-1] ** 2
    inverse = np.zeros_like(normal)
    inverse[np.ix_(ordered, ordered)] = np.linalg.inv(normal)
    inverse /= np.outer(scale, scale)
    residuals = tuple(block.Y - block.W @ x for block in fit.blocks)
    # the residual is shared out: every noisy column takes its part of it
    share = np.zeros(len(x))
    share[noisy] = scale[noisy] / y_scale * free / (1.0 + float(free @ free))
    moved = tuple(block.W + np.outer(e, share) for block, e in zip(fit.blocks, residuals, strict=True))
    solution = replace(fit.solution, x=x, inverse=inverse)
    projected = plain_regressors(moved)
    return replace(fit, solution=solution, residuals=residuals, projected=projected, notes=(*fit.notes, NOTE))


def _exact(model: Model, column: str) -> bool:
    """Tell whether a column is free of noise: a constant, or a direction of motion."""
    index = model.base_parameters.index(column)
    functions = {feature.key: feature for feature in model.features}
    keys = [key for row in range(len(model.rows)) for _, key in model.column_terms(row, index)]
    return all(
        key == "1"
        or (key in functions and functions[key].function != "cube" and functions[key].times is None)
        for key in keys
    )
