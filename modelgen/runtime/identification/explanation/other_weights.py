"""What other weights of rows and records move, where the model lacks something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.explanation.unrelated_regressions import across_rows
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import DISAGREEMENT, LEFT_SHARE, OVER_NOISE
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage


def other_weights(job: Job, fit: Fit) -> tuple[FloatArray, tuple[Advice, ...]]:
    """Return what other weights of rows and records move, where the model lacks something, and what is said.

    What a link lacks is left by both of its bodies' rows: weights across rows know that. Weights from
    residuals hide a row that the model does not explain; weights from the rows' own size do not.

    Returns
    -------
    array, shape (c, c)
        In SI: mean square of the moves, and the covariance with the last weights.
    tuple of Advice
    """
    c = len(fit.columns)
    if fit.carried is not None or len(fit.blocks) < 2:
        return np.zeros((c, c)), ()
    exceeding = exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE)
    if not exceeding:
        return np.zeros((c, c)), ()
    across = across_rows(fit)
    # what these weights hardly determine does not disagree
    known = np.diag(hac_covariance(across)) < DISAGREEMENT**2 * np.diag(hac_covariance(fit))
    move = np.where(known, across.solution.x - fit.solution.x, 0.0)
    drift = np.outer(move, move)
    left = [(block, share) for block, share in exceeding if share > LEFT_SHARE]
    if not left:
        return drift, ()
    sizes = [
        block.terms_norm(fit.solution.x) / float(np.sqrt(len(block.place))) or 1.0 for block in fit.blocks
    ]
    weighed = replace(fit, weights=tuple(1.0 / size for size in sizes))
    other = two_stage(weighed, fit.regressors)
    move = other.solution.x - fit.solution.x
    advice = Advice(
        "unexplained",
        ", ".join(f"{block.record_name}, row {block.row_name}" for block, _ in left),
        f"leaves up to {100.0 * max(share for _, share in left):.0f} % of its largest term, more than noise "
        "explains: dynamics that the model lacks (a further mass, a resonance, backlash); the intervals "
        "hold what these rows would move",
        "identify from each record alone and compare, or add what is missing to the spec",
    )
    return drift + np.outer(move, move) + hac_covariance(other), (advice,)
