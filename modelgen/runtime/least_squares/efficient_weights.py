"""A fit with instruments, solved again on white rows: each frequency weighs by what noise leaves of it there.

Weights of one number a row waste what is known at the frequencies where a row has little noise, and count
noise that several rows share as if each had its own. Rows, regressors and instruments behind one causal
filter that makes the residual white (generalised least squares, Aitken 1935; for instruments Young 1976) come
close to the Cramer-Rao bound. The residuals that are looked at stay those of the rows as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.hac_covariance import influence
from modelgen.runtime.least_squares.joint_whitening import WhiteFit, WhiteRows, joint_whiteners
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.row_prediction import RowResiduals
from modelgen.runtime.least_squares.thresholds import LEAST_NOISE, SAME_STEP
from modelgen.runtime.least_squares.whitening import Whitener, whiteners


def white_rows(fit: Fit, steps_s: Sequence[float] | None = None) -> WhiteRows:
    """Return what makes the residuals of a fit white, those of records that share their noise together.

    Parameters
    ----------
    fit : Fit
    steps_s : sequence of float, optional
        Time in s between instants of each record's grid; by default all have the same.
    """
    parts = []
    for alike in records_alike(fit, steps_s):
        rises = [fit.blocks[index].differentiated for index in alike[0]]
        white = joint_whiteners([_residuals(fit, ours) for ours in alike], rises)
        parts += [(tuple(ours), one) for ours, one in zip(alike, white, strict=True)]
    return WhiteRows(tuple(parts))


def records_alike(fit: Fit, steps_s: Sequence[float] | None = None) -> list[list[list[int]]]:
    """Return the blocks of each record, records with the same rows at the same steps in s together."""
    found: dict[tuple[float, tuple[int, ...]], list[list[int]]] = {}
    for record, ours in fit.by_record.items():
        step = 0.0 if steps_s is None else round(float(np.log(steps_s[record])) / SAME_STEP)
        found.setdefault((step, tuple(fit.blocks[index].row for index in ours)), []).append(ours)
    return list(found.values())


def block_whiteners(fit: Fit, steps_s: Sequence[float], most: int) -> list[Whitener]:
    """Return what makes the residual of each block of a fit white by itself, of that order at most.

    `steps_s` as in `white_rows`.
    """
    found: dict[int, Whitener] = {}
    for alike in records_alike(fit, steps_s):
        for blocks in zip(*alike, strict=True):  # one row's, of each record
            places = [fit.blocks[index].place for index in blocks]
            found.update(
                zip(blocks, whiteners([fit.residuals[i] for i in blocks], places, most), strict=True)
            )
    return [found[index] for index in range(len(fit.blocks))]


def _residuals(fit: Fit, ours: Sequence[int]) -> RowResiduals:
    """Return what the blocks of one record leave."""
    blocks = [fit.blocks[index] for index in ours]
    sizes = [block.terms_norm(fit.solution.x) / float(np.sqrt(max(block.count, 1))) for block in blocks]
    return RowResiduals(
        tuple(fit.residuals[index] for index in ours),
        tuple(block.place for block in blocks),
        blocks[0].grid,
        tuple(LEAST_NOISE * size for size in sizes),
    )


def efficient(fit: Fit, steps_s: Sequence[float] | None = None) -> Fit:
    """Return a fit with instruments with the solution, and the influence series, of its white rows.

    Blocks, weights and what Y was regressed on stay: whatever is looked at is looked at in these. Parameters
    as in `white_rows`.
    """
    c, regressors = len(fit.columns), fit.regressors
    white_of, m = white_rows(fit, steps_s), c if regressors.mix is None else len(regressors.mix)
    stacked = [
        np.vstack([one.samples.T, block.W.T, block.Y]).T
        for one, block in zip(regressors, fit.blocks, strict=True)
    ]
    # columns of instruments, those of W, and Y, one after the other
    places = [
        np.r_[np.arange(m) if one.places is None else one.places, m + fit.touched(index), m + c]
        for index, one in enumerate(regressors)
    ]
    blocks, samples, of = [], [], []
    for block, (white, own) in zip(fit.blocks, white_of.columns(stacked, places), strict=True):
        k = int(np.searchsorted(own, m))
        samples.append(white[:, :k])
        of.append(None if regressors.plain else own[:k])
        touched = None if block.touched is None else own[k:-1] - m
        blocks.append(replace(block.kept(), W=white[:, k:-1], Y=white[:, -1], touched=touched))
    lost = white_of.lost
    plain = replace(fit, blocks=tuple(blocks), weights=(1.0,) * len(blocks), lost=lost)
    found = two_stage(plain, replace(regressors, samples=tuple(samples), places=tuple(of)))
    solution = replace(fit.solution, x=found.solution.x, inverse=found.solution.inverse)
    return replace(
        fit,
        solution=solution,
        residuals=residuals_of(fit.blocks, solution.x),
        lost=lost,
        series=tuple(influence(found)),
        white=WhiteFit(white_of, found.regressors, solution.inverse),
    )
