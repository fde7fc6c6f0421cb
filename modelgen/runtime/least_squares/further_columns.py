"""Columns that a fit has for a while: with them, and with them projected out of its regressors.

What is fitted together with further columns is what their projection leaves (Frisch and Waugh 1933): the fit
without them then has the same solution, and a covariance that leaves them free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit, regressed_rows, residuals_of
from modelgen.runtime.least_squares.projected_least_squares import two_stage, with_regressors
from modelgen.runtime.numerics.qr_triangle import joined_triangle
from modelgen.runtime.numerics.regressor import Regressors
from modelgen.runtime.rows.row_block import RowBlock


def with_columns(
    fit: Fit,
    Z: Regressors | Sequence[FloatArray],
    extra: Sequence[Sequence[FloatArray]],
    further: Sequence[Sequence[FloatArray]] = (),
) -> Fit:
    """Return the fit of the same weighted rows with further columns.

    Parameters
    ----------
    fit : Fit
    Z : Regressors, or sequence of array
        Instruments of its own columns, as `two_stage` takes them.
    extra : sequence of sequence of array
        The further columns: of each one array a block, in SI, shape (n,).
    further : sequence of sequence of array
        Their instruments; by default they are their own.
    """
    c, names = len(fit.columns), tuple(f"further {index}" for index in range(len(extra)))
    if not isinstance(Z, Regressors):
        Z = Regressors(tuple(Z), tuple(block.touched for block in fit.blocks), None, c)
    elif Z.mix is not None and len(Z.mix) == c:
        # as many columns as are mixed: what they span, and the solution, is the same
        Z = replace(Z, mix=None, made=None)
    joined = Z.joined(further or extra)
    return two_stage(replace(fit, columns=fit.columns + names, blocks=joined_blocks(fit, extra)), joined)


def joined_blocks(fit: Fit, extra: Sequence[Sequence[FloatArray]]) -> tuple[RowBlock, ...]:
    """Return the blocks of a fit with further columns behind its own, in SI, (n,) a block each."""
    W = replace(fit, projected=None).regressors.joined(extra)
    return tuple(
        replace(block.kept(), W=samples, touched=places)
        for block, samples, places in zip(fit.blocks, W.samples, W.places, strict=True)
    )


def without_columns(larger: Fit, fit: Fit) -> Fit:
    """Return a fit of the same rows to its own columns, the further ones of a larger fit projected out."""
    c = len(fit.columns)
    projected = _projected_out(larger.regressors, larger.triangle, c)
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
        white=larger.white,
    )


def with_columns_free(fit: Fit, extra: Sequence[Sequence[FloatArray]]) -> Fit:
    """Return a least-squares fit that leaves further columns free, those that `with_columns` would take.

    Each has shape (n,) a block, in the unit of the row over that of its factor.
    """
    joined = fit.regressors.joined(extra)
    triangle = joined_triangle(regressed_rows(fit.blocks, fit.weights, joined))
    return with_regressors(fit, _projected_out(joined, triangle, len(fit.columns)))


def _projected_out(joined: Regressors, triangle: FloatArray, c: int) -> Regressors:
    """Return the first c columns less their projection on the further ones.

    `triangle` is R of the weighted [columns, Y], shape (columns + 1, columns + 1).
    """
    inner = triangle[:-1, :-1]
    scale = np.linalg.norm(inner[:, c:], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    share = np.linalg.lstsq(inner[:, c:] / scale, inner[:, :c], rcond=None)[0] / scale[:, None]
    return joined.mixed(np.vstack([np.eye(c), -share]))
