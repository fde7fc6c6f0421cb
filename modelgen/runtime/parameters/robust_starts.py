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
from modelgen.runtime.parameters.nearest_parameters import alike
from modelgen.runtime.parameters.thresholds import (
    LARGEST_LOG_STEP,
    LEAST_SHARE,
    NEAREST_STARTS,
    OPTIMISM,
    ROBUST_DAMPING,
    ROBUST_SHARE,
    ROBUST_STEPS,
    SAME_MISFIT,
    SPREAD,
)

SEED = 2002


def robust_starts(model: Model, base: FloatArray, std: FloatArray) -> tuple[Mapping[str, float], ...]:
    """Return sets of all physical parameters (SI) to start a weighted fit from.

    Parameters
    ----------
    model : Model
        With composites.
    base, std : array, shape (columns,)
        All its base parameters, and their standard deviations, zero where there is none.
    """
    rng = np.random.default_rng(SEED)
    # one is bent and the others are good, or all are as good as they say, but for a factor
    relative = std / np.where(base == 0.0, 1.0, np.abs(base))
    shares = (np.full(base.shape, ROBUST_SHARE), np.maximum(LEAST_SHARE, OPTIMISM * relative))
    found: list[dict[str, float]] = []
    # a trial far off may leave the range of numbers: its loss is not finite, and the step is shortened
    with np.errstate(all="ignore"):
        for share in shares:
            for _ in range(NEAREST_STARTS):
                start = rng.normal(0.0, SPREAD, len(model.parameters))
                values = _values(model, _descended(model, base, share, start))
                one = dict(zip(model.parameters, values.tolist(), strict=True))
                if np.isfinite(values).all() and not any(alike(one, other) for other in found):
                    found.append(one)
    return tuple(found)


def _descended(model: Model, base: FloatArray, share: FloatArray, x: FloatArray) -> FloatArray:
    """Return the variables that Levenberg and Marquardt's steps lead to from a start."""
    error, given = _errors(model, base, x)
    loss, damping = _loss(error / share), ROBUST_DAMPING
    for _ in range(ROBUST_STEPS):
        slope = _slope(model, base, x, given)
        weighted = slope.T / (share**2 + error**2)
        A, b = weighted @ slope, -weighted @ error
        if not np.isfinite(loss) or not np.isfinite(A).all():
            return np.full_like(x, np.nan)
        while damping < 1.0 / np.finfo(float).eps:
            stiffer = A + damping * np.diag(np.diag(A) + ROBUST_DAMPING * np.trace(A))
            step = np.linalg.lstsq(stiffer, b, rcond=None)[0]
            trial = x + np.clip(step, -LARGEST_LOG_STEP, LARGEST_LOG_STEP)
            error, given = _errors(model, base, trial)
            following = _loss(error / share)
            if following < loss:
                break
            damping *= 4.0
        else:
            return x
        before, loss, x = loss, following, trial
        damping /= 6.0
        if before - loss < SAME_MISFIT**2 * loss:
            break
    return x


def _loss(error: FloatArray) -> float:
    return float(np.sum(np.log1p(error**2)))


def _errors(model: Model, base: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return relative errors of the base parameters, shape (columns,), and what the variables make of these.

    Errors are logarithms of ratios where the signs agree.
    """
    given = model.base_from_physical(dict(zip(model.parameters, _values(model, x).tolist(), strict=True)))
    alike = given * base > 0.0
    ratio = np.where(alike, given / np.where(alike, base, 1.0), 1.0)
    return np.where(alike, np.log(ratio), (given - base) / _sizes(base)), given


def _slope(model: Model, base: FloatArray, x: FloatArray, given: FloatArray) -> FloatArray:
    """Return how relative errors grow with the variables, shape (columns, parameters)."""
    values = dict(zip(model.parameters, _values(model, x).tolist(), strict=True))
    by_variable = model.base_jacobian(values) * np.where(_signed(model), np.cosh(x), np.exp(x))
    return np.asarray(by_variable / np.where(given * base > 0.0, given, _sizes(base))[:, None])


def _sizes(base: FloatArray) -> FloatArray:
    return np.where(base == 0.0, 1.0, np.abs(base))


def _values(model: Model, x: FloatArray) -> FloatArray:
    """Return parameters of their logarithms (area sines of those that may be negative)."""
    return np.where(_signed(model), np.sinh(x), np.exp(x))


def _signed(model: Model) -> list[bool]:
    return [
        name not in model.roles or model.roles[name].role in ("offset", "stiffness3")
        for name in model.parameters
    ]
