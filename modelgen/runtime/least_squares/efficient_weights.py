"""A fit with instruments, solved again on white rows: each frequency weighs by what noise leaves of it there.

Weights of one number a row waste what is known at the frequencies where a row has little noise, and count
noise that several rows share as if each had its own. Rows, regressors and instruments behind one causal
filter that makes the residual white (generalised least squares, Aitken 1935; for instruments Young 1976) come
close to the Cramer-Rao bound. The residuals that are looked at stay those of the rows as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.hac_covariance import influence
from modelgen.runtime.least_squares.joint_whitening import JointWhitener, joint_whitener
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.thresholds import LEAST_NOISE


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """Makes what stands in the rows of a fit white; `parts` are each record's blocks and whitener."""

    parts: tuple[tuple[tuple[int, ...], JointWhitener], ...]

    @property
    def lost(self) -> int:
        """Coefficients that were estimated."""
        return sum(white_of.lost for _, white_of in self.parts)

    def __call__(self, samples: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        """Return samples of every block, shape (n, m) each, with the residuals' colour taken off."""
        found = list(samples)
        for ours, white_of in self.parts:
            for index, white in zip(ours, white_of([samples[index] for index in ours]), strict=True):
                found[index] = white
        return tuple(found)


def white_rows(fit: Fit) -> WhiteRows:
    """Return what makes the residuals of a fit white, each record for itself."""
    parts = []
    for ours in fit.by_record.values():
        blocks = [fit.blocks[index] for index in ours]
        least = [
            LEAST_NOISE * block.terms_norm(fit.solution.x) / float(np.sqrt(max(block.count, 1)))
            for block in blocks
        ]
        residuals = [fit.residuals[index] for index in ours]
        places = [block.place for block in blocks]
        rises = [block.differentiated for block in blocks]
        parts.append((tuple(ours), joint_whitener(residuals, places, blocks[0].grid, least, rises)))
    return WhiteRows(tuple(parts))


def efficient(fit: Fit) -> Fit:
    """Return a fit with instruments with the solution, and the influence series, of its white rows.

    Blocks, weights and what Y was regressed on stay: whatever is looked at is looked at in these.
    """
    fit, c = fit.dense(), len(fit.columns)
    white_of = white_rows(fit)
    stacked = [
        np.vstack([r.T, block.W.T, block.Y]).T for r, block in zip(fit.regressors, fit.blocks, strict=True)
    ]
    white = white_of(stacked)
    blocks = tuple(
        replace(block.kept(), W=part[:, c:-1], Y=part[:, -1])
        for block, part in zip(fit.blocks, white, strict=True)
    )
    lost = white_of.lost
    plain = replace(fit, blocks=blocks, weights=(1.0,) * len(blocks), lost=lost)
    found = two_stage(plain, tuple(part[:, :c] for part in white))
    solution = replace(fit.solution, x=found.solution.x, inverse=found.solution.inverse)
    return replace(
        fit,
        solution=solution,
        residuals=residuals_of(fit.blocks, solution.x),
        lost=lost,
        series=tuple(influence(found)),
    )
