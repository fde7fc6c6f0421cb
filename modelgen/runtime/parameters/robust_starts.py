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
    misfit, found = _Misfit(model, base), list[dict[str, float]]()
    # a trial far off may leave the range of numbers: its loss is not finite, and the step is shortened
    with np.errstate(all="ignore"):
        for share in shares:
            for _ in range(NEAREST_STARTS):
                start = rng.normal(0.0, SPREAD, len(model.parameters))
                one = misfit.values(misfit.descended(share, start))
                finite = np.isfinite([*one.values()]).all()
                if finite and not any(alike(one, other) for other in found):
                    found.append(one)
    return tuple(found)


class _Misfit:
    """How far parameters are from the composites; their variables are logarithms, shape (parameters,).

    Those that may be negative have area sines.
    """

    def __init__(self, model: Model, base: FloatArray) -> None:
        self._model, self._base = model, base
        self._sizes = np.where(base == 0.0, 1.0, np.abs(base))
        self._signed = np.array(
            [
                name not in model.roles or model.roles[name].role in ("offset", "stiffness3")
                for name in model.parameters
            ]
        )

    def descended(self, share: FloatArray, x: FloatArray) -> FloatArray:
        """Return the variables that Levenberg and Marquardt's steps lead to from a start."""
        values = self.values(x)
        error, given = self._errors(values)
        loss, damping = _loss(error / share), ROBUST_DAMPING
        for _ in range(ROBUST_STEPS):
            slope = self._slope(x, values, given)
            weighted = slope.T / (share**2 + error**2)
            A, b = weighted @ slope, -weighted @ error
            if not np.isfinite(loss) or not np.isfinite(A).all():
                return np.full_like(x, np.nan)
            own = np.diag(np.diag(A) + ROBUST_DAMPING * np.trace(A))
            while damping < 1.0 / np.finfo(float).eps:
                step = np.linalg.lstsq(A + damping * own, b, rcond=None)[0]
                trial = x + np.clip(step, -LARGEST_LOG_STEP, LARGEST_LOG_STEP)
                values = self.values(trial)
                error, given = self._errors(values)
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

    def values(self, x: FloatArray) -> dict[str, float]:
        """Return the parameters of variables, in SI."""
        values = np.where(self._signed, np.sinh(x), np.exp(x))
        return dict(zip(self._model.parameters, values.tolist(), strict=True))

    def _errors(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Return relative errors of the base parameters, shape (columns,), and what the values make of these.

        Errors are logarithms of ratios where the signs agree.
        """
        given, base = self._model.base_from_physical(values), self._base
        agree = given * base > 0.0
        ratio = np.where(agree, given / np.where(agree, base, 1.0), 1.0)
        return np.where(agree, np.log(ratio), (given - base) / self._sizes), given

    def _slope(self, x: FloatArray, values: Mapping[str, float], given: FloatArray) -> FloatArray:
        """Return how relative errors grow with the variables, shape (columns, parameters)."""
        by_variable = self._model.base_jacobian(values) * np.where(self._signed, np.cosh(x), np.exp(x))
        return np.asarray(by_variable / np.where(given * self._base > 0.0, given, self._sizes)[:, None])


def _loss(error: FloatArray) -> float:
    return float(np.sum(np.log1p(error**2)))
