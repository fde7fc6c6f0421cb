"""Physical parameters that come close to most composites, whatever becomes of a few that noise has bent.

Least squares of relative errors give way in all parameters to explain one composite that is many times too
large; a fit to that start may then end at bodies of no size, or of any. With Cauchy's loss, which grows as
the logarithm of an error, such a composite counts hardly at all.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.thresholds import (
    LARGEST_LOG_STEP,
    NEAREST,
    NEAREST_STARTS,
    ROBUST_DAMPING,
    ROBUST_SHARE,
    ROBUST_STEPS,
    SAME_MISFIT,
    SPREAD,
)

SEED = 2002


def robust_starts(model: Model, base: FloatArray) -> tuple[Mapping[str, float], ...]:
    """Return sets of all physical parameters (SI) to start a weighted fit from, nearest first.

    Parameters
    ----------
    model : Model
        With composites.
    base : array, shape (columns,)
        All its base parameters.
    """
    rng = np.random.default_rng(SEED)
    found: list[tuple[float, FloatArray]] = []
    # a trial far off may leave the range of numbers: its loss is not finite, and the step is shortened
    with np.errstate(all="ignore"):
        for _ in range(NEAREST_STARTS):
            loss, x = _descended(model, base, rng.normal(0.0, SPREAD, len(model.parameters)))
            if np.isfinite(loss) and not any(abs(loss - one) <= SAME_MISFIT * one for one, _ in found):
                found.append((loss, x))
        nearest = sorted(found, key=lambda one: one[0])[:NEAREST]
        sets = [_values(model, x) for _, x in nearest]
    return tuple(dict(zip(model.parameters, values.tolist(), strict=True)) for values in sets)


def _descended(model: Model, base: FloatArray, x: FloatArray) -> tuple[float, FloatArray]:
    """Return the loss and the variables that Levenberg and Marquardt's steps lead to from a start."""
    error, slope = _errors(model, base, x)
    loss, damping = _loss(error), ROBUST_DAMPING
    for _ in range(ROBUST_STEPS):
        weighted = slope.T / (1.0 + (error / ROBUST_SHARE) ** 2)
        A, b = weighted @ slope, -weighted @ error
        if not np.isfinite(loss) or not np.isfinite(A).all():
            return np.inf, x
        while damping < 1.0 / np.finfo(float).eps:
            stiffer = A + damping * np.diag(np.diag(A) + ROBUST_DAMPING * np.trace(A))
            step = np.linalg.lstsq(stiffer, b, rcond=None)[0]
            trial = x + np.clip(step, -LARGEST_LOG_STEP, LARGEST_LOG_STEP)
            error, slope = _errors(model, base, trial)
            if _loss(error) < loss:
                break
            damping *= 4.0
        else:
            return loss, x
        before, loss, x = loss, _loss(error), trial
        damping /= 6.0
        if before - loss < SAME_MISFIT**2 * loss:
            break
    return loss, x


def _loss(error: FloatArray) -> float:
    return float(np.sum(np.log1p((error / ROBUST_SHARE) ** 2)))


def _errors(model: Model, base: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return relative errors of the base parameters, shape (columns,), and their slope by the variables.

    Errors are logarithms of ratios where the signs agree.
    """
    values = dict(zip(model.parameters, _values(model, x).tolist(), strict=True))
    given = model.base_from_physical(values)
    alike = given * base > 0.0
    size = np.where(base == 0.0, 1.0, np.abs(base))
    ratio = np.where(alike, given / np.where(alike, base, 1.0), 1.0)
    error = np.where(alike, np.log(ratio), (given - base) / size)
    by_variable = model.base_jacobian(values) * np.where(_signed(model), np.cosh(x), np.exp(x))
    return error, by_variable / np.where(alike, given, size)[:, None]


def _values(model: Model, x: FloatArray) -> FloatArray:
    """Return parameters of their logarithms (area sines of those that may be negative)."""
    return np.where(_signed(model), np.sinh(x), np.exp(x))


def _signed(model: Model) -> list[bool]:
    return [
        name not in model.roles or model.roles[name].role in ("offset", "stiffness3")
        for name in model.parameters
    ]
