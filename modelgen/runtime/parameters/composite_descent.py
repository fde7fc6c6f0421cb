"""The descent from any physical parameters to those that come closest to composites of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.thresholds import (
    ANY_SHARE,
    LARGEST_LOG_STEP,
    ROBUST_DAMPING,
    ROBUST_STEPS,
    SAME_MISFIT,
)


class CompositeDescent:
    """Steps from physical parameters to those that come closest to composites, from any start.

    The variables are logarithms of all parameters in SI, shape (parameters,), area sines of those that may be
    negative: quotients of parameters are tame there. `base` holds all base parameters, shape (columns,), SI.
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
        """Return the variables that Levenberg and Marquardt's steps lead to from a start, NaN where to none.

        Relative errors beyond their `share`, shape (columns,), count less and less (Cauchy's loss).
        """
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

    def nearest(self, x: FloatArray) -> tuple[dict[str, float], float]:
        """Return the parameters of least squares of relative errors, and that sum of squares.

        From a start `x`, shape (parameters,), in logarithms of SI.
        """
        with np.errstate(all="ignore"):
            values = self.values(self.descended(np.full(self._base.shape, ANY_SHARE), x))
            if not np.isfinite([*values.values()]).all():
                return values, np.inf
            error, _ = self._errors(values)
            return values, float(error @ error)

    def values(self, x: FloatArray) -> dict[str, float]:
        """Return the parameters of variables, shape (parameters,), in SI."""
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
