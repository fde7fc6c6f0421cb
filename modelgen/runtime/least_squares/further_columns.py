"""Columns that a fit has for a while: with them, and with them projected out of its regressors.

What is fitted together with further columns is what their projection leaves (Frisch and Waugh 1933): the fit
without them then has the same solution, and a covariance that leaves them free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.projected_least_squares import two_stage, with_regressors


def with_columns(fit: Fit, Z: Sequence[FloatArray], extra: Sequence[FloatArray]) -> Fit:
    """Return the fit of the same weighted rows with further columns.

    Parameters
    ----------
    fit : Fit
    Z : sequence of array
        Instruments of its own columns, shape (n, columns) a block.
    extra : sequence of array
        The further columns, which are their own instruments, shape (n, further) a block.
    """
    fit = fit.dense()
    blocks = tuple(
        replace(block.kept(), W=np.column_stack([block.W, more]))
        for block, more in zip(fit.blocks, extra, strict=True)
    )
    names = tuple(f"further {index}" for index in range(extra[0].shape[1]))
    stacked = tuple(np.column_stack([z, more]) for z, more in zip(Z, extra, strict=True))
    return two_stage(replace(fit, columns=fit.columns + names, blocks=blocks), stacked)


def without_columns(larger: Fit, fit: Fit) -> Fit:
    """Return a fit of the same rows to its own columns, the further ones of a larger fit projected out."""
    c = len(fit.columns)
    stacked = np.concatenate([w * r for w, r in zip(larger.weights, larger.regressors, strict=True)])
    scale = np.linalg.norm(stacked[:, c:], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    share = np.linalg.lstsq(stacked[:, c:] / scale, stacked[:, :c], rcond=None)[0] / scale[:, None]
    projected = tuple(r[:, :c] - r[:, c:] @ share for r in larger.regressors)
    found = with_regressors(replace(fit, weights=larger.weights), projected)
    if larger.series is None:
        return found
    # solved with other weights: their solution, and what it leaves free, hold
    x, inverse = larger.solution.x[:c], larger.solution.inverse[:c, :c]
    return replace(
        found,
        solution=replace(found.solution, x=x, inverse=inverse),
        residuals=residuals_of(found.blocks, x),
        lost=larger.lost,
        series=tuple(psi[:, :c] for psi in larger.series),
    )
