"""Robust weighting (Huber 1964): samples with large residuals pull less, by iterated re-weighting.

A residual beyond k standard deviations counts with weight k sigma / |e|; k = 1.345 keeps 95 % of the
efficiency where the noise is normal. The standard deviation of a block is that of the median, which outliers
do not move. The covariance is the sandwich: the scores psi(e) W with their correlations, between inverses of
sum psi'(e) W^T W.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.thresholds import HUBER_ROUNDS, SMALL_MOVE, TUNING

# median |e| of normal noise, as a share of its standard deviation
MEDIAN_OF_NORMAL = 0.6744897501960817


def huber(fit: Fit) -> tuple[Fit, tuple[FloatArray, ...]]:
    """Return the robust fit to the rows of a fit, and the weights of its samples, one array a block.

    Parameters
    ----------
    fit : Fit
        Least squares, or instrumental variables (the same instruments are kept).

    Returns
    -------
    Fit
        Its rows carry the roots of the weights, and its solution's `inverse` is that of sum psi'(e) W^T W, so
        that its influence series, and every covariance made from it, are those of the robust estimate.
    tuple of array
        Shape (n,) each.

    Raises
    ------
    IdentifiabilityError
        When the weights do not come to rest.
    """
    fit = fit.dense()
    found = fit
    # residuals in units of their own spread: blocks keep the weights that the fit has given them
    for _ in range(HUBER_ROUNDS):
        plain = [block.Y - block.W @ found.solution.x for block in fit.blocks]
        scales = [_spread(e) for e in plain]
        weights = tuple(_weights(e, scale) for e, scale in zip(plain, scales, strict=True))
        following = _weighted(fit, weights)
        spread = np.sqrt(np.maximum(np.diag(following.solution.inverse), 0.0))
        move = np.abs(following.solution.x - found.solution.x)
        found = following
        if np.all(move <= SMALL_MOVE * spread):
            return _with_sandwich(fit, found, weights), weights
    remedy = "identify without robust weighting, and look at the residual"
    raise IdentifiabilityError.at("robust", f"weights still move after {HUBER_ROUNDS} rounds", remedy)


def huber_notes(weights: tuple[FloatArray, ...]) -> tuple[str, ...]:
    """Return the sentence that says how many samples count less; weights of shape (n,) a block."""
    every = np.concatenate(weights)
    less = int(np.sum(every < 1.0))
    share = 100.0 * less / len(every)
    return (
        f"robust (Huber, {TUNING}): {less} of {len(every)} samples ({share:.2g} %) weigh less than 1, the "
        f"least {float(every.min()):.2g}; normal noise alone gives 18 %",
    )


def _weighted(fit: Fit, weights: tuple[FloatArray, ...]) -> Fit:
    """Return the fit to the rows of `fit` times the roots of weights."""
    roots = [np.sqrt(weight) for weight in weights]
    blocks = tuple(
        replace(block.kept(), Y=root * block.Y, W=root[:, None] * block.W)
        for block, root in zip(fit.blocks, roots, strict=True)
    )
    Z = tuple(root[:, None] * r.samples for root, r in zip(roots, fit.regressors, strict=True))
    solved = two_stage(replace(fit, blocks=blocks), Z)
    return solved if fit.projected is not None else replace(solved, projected=None)


def _with_sandwich(fit: Fit, found: Fit, weights: tuple[FloatArray, ...]) -> Fit:
    """Return the fit with the inverse of sum psi'(e) R^T R, to which samples beyond the bend add nothing."""
    parts = zip(fit.weights, fit.regressors, weights, strict=True)
    inside = np.concatenate([weight * r.samples[inner >= 1.0] for weight, r, inner in parts])
    scale = np.linalg.norm(inside, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    triangle = np.asarray(np.linalg.qr(inside / scale, mode="r"))
    inverse = np.linalg.pinv(triangle.T @ triangle) / np.outer(scale, scale)
    return replace(found, solution=replace(found.solution, inverse=inverse))


def _spread(residual: FloatArray) -> float:
    """Return the standard deviation of normal noise with this median of |e|."""
    return float(np.median(np.abs(residual))) / MEDIAN_OF_NORMAL


def _weights(residual: FloatArray, spread: float) -> FloatArray:
    size = np.abs(residual)
    bend = TUNING * spread
    return np.where(size <= bend, 1.0, bend / np.maximum(size, np.finfo(float).tiny))
