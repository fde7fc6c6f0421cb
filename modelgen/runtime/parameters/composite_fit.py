"""Physical parameters fitted to composites of them, and whether the composites agree with each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.decorrelation import whitening
from modelgen.runtime.numerics.tails import chi_square_beyond
from modelgen.runtime.parameters.thresholds import (
    CONTRADICTION,
    CONVERGED,
    NULL_SHARE,
    RANK_TOLERANCE,
    SMALL_STEP,
    SMALLEST_SPREAD,
    STEPS,
)

SEED = 2002


@dataclass(frozen=True, eq=False)
class PhysicalSolution:
    """Values of physical parameters, their gradients by the identified base ones, and which are determined.

    `misfit` is the weighted sum of squares that the composites leave, zero where they only just suffice.
    `left` maps errors of the composites to the weighted part of them that no parameter takes up, shape
    (spare, identified), and `error` is what of that is there, shape (spare,).
    """

    values: Mapping[str, float]
    gradients: Mapping[str, FloatArray]
    determined: frozenset[str]
    misfit: float
    left: FloatArray
    error: FloatArray

    def left_over(self, covariance: FloatArray) -> tuple[float, int]:
        """Return the chi square of what is left of the composites, and its degrees of freedom.

        `covariance` is that of the composites, in SI, shape (identified, identified).
        """
        if not self.error.size:
            return 0.0, 0
        whiten = whitening(self.left @ covariance @ self.left.T, SMALLEST_SPREAD)
        return float(np.sum((whiten @ self.error) ** 2)), self.error.size

    def contradiction(self, covariance: FloatArray) -> float:
        """Return by which factor the composites contradict each other, in standard deviations; 1 where not.

        `covariance` is that of the composites, shape (identified, identified). What is left of them is then a
        chi square, and the factor, where that is too large, its root per degree of freedom (Birge 1932).
        """
        found, spare = self.left_over(covariance)
        apart = spare and found > chi_square_beyond(CONTRADICTION, spare)
        return float(np.sqrt(found / spare)) if apart else 1.0


def fit_composites(
    model: Model, base: FloatArray, covariance: FloatArray, start: Mapping[str, float]
) -> PhysicalSolution:
    """Fit all physical parameters to the identified base ones, weighted by their covariance, from a start.

    `base` holds all base parameters of the model, shape (columns,), NaN for those that are not identified;
    `covariance` is that of the others, shape (identified, identified). All in SI units.
    """
    identified = np.flatnonzero(np.isfinite(base))
    p = np.array([start[name] for name in model.parameters])
    size = np.where(p == 0.0, 1.0, np.abs(p))
    whiten = whitening(covariance, SMALLEST_SPREAD)

    def mismatch(p: FloatArray) -> FloatArray:
        values = model.base_from_physical(dict(zip(model.parameters, p.tolist(), strict=True)))
        return np.asarray(whiten @ (base - values)[identified])

    def slope(p: FloatArray) -> FloatArray:
        jacobian = model.base_jacobian(dict(zip(model.parameters, p.tolist(), strict=True)))
        return np.asarray(whiten @ jacobian[identified] * size)

    error = mismatch(p)
    for _ in range(STEPS):
        step = np.linalg.lstsq(slope(p), error, rcond=RANK_TOLERANCE)[0]
        # half steps until the misfit falls: a composite may be far from linear
        while np.abs(step).max() > SMALL_STEP and not _smaller(mismatch(p + step * size), error):
            step = 0.5 * step
        p = p + step * size
        error = mismatch(p)
        if np.abs(step).max() <= CONVERGED:
            break
    weighted = slope(p)
    gradients = size[:, None] * (np.linalg.pinv(weighted, rcond=RANK_TOLERANCE) @ whiten)
    known = np.logical_and(_known(weighted), _known_anywhere(model, identified))
    determined = [name for name, told in zip(model.parameters, known.tolist(), strict=True) if told]
    U, s, _ = np.linalg.svd(weighted)
    spare = U[:, int(np.sum(s > RANK_TOLERANCE * s[0])) :].T
    return PhysicalSolution(
        dict(zip(model.parameters, p.tolist(), strict=True)),
        dict(zip(model.parameters, gradients, strict=True)),
        frozenset(determined),
        float(error @ error),
        spare @ whiten,
        spare @ error,
    )


def _smaller(error: FloatArray, than: FloatArray) -> bool:
    return bool(error @ error < than @ than)


def _known_anywhere(model: Model, identified: IntArray) -> list[bool]:
    """Return which parameters the identified base ones determine at a point that is nothing special.

    Where the fit ends at a body of no size, what moves with that body does not show: its share of the others
    is none there, of sizes that a machine has it is not. A gear makes it small in any case: neither rows nor
    columns count by their size.
    """
    sizes = np.random.default_rng(SEED).uniform(1.0, 2.0, len(model.parameters))
    slope = model.base_jacobian(dict(zip(model.parameters, sizes.tolist(), strict=True)))[identified] * sizes
    for axis in (1, 0):
        length = np.linalg.norm(slope, axis=axis, keepdims=True)
        slope = slope / np.where(length > 0.0, length, 1.0)
    return _known(slope)


def _known(slope: FloatArray) -> list[bool]:
    """Return which parameters take no part in a direction that leaves all base parameters as they are."""
    _, s, Vt = np.linalg.svd(slope, full_matrices=True)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0]))
    return [bool(known) for known in np.all(np.abs(Vt[rank:]) < NULL_SHARE, axis=0)]
