"""From the base parameters that were identified to the physical ones, with their standard deviations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.contract import Model
from modelgen.runtime.estimate import Parameter

FloatArray = npt.NDArray[np.float64]

# Central differences of smooth functions: the cube root of the rounding error.
RELATIVE_STEP = 6e-6


@dataclass(frozen=True, eq=False)
class Covariances:
    """Covariances of the identified base parameters, shape (identified, identified) each.

    `total` is the sum of `noise` (residuals) and `drift` (settings); `printed` is the paper's, eq. (11).
    """

    total: FloatArray
    noise: FloatArray
    drift: FloatArray
    printed: FloatArray

    def standard_deviations(self, gradient: FloatArray) -> tuple[float, float, float, float]:
        """Return those of a function with this gradient, to first order, in the order of the attributes."""
        variances = [
            gradient @ matrix @ gradient for matrix in (self.total, self.noise, self.drift, self.printed)
        ]
        total, noise, drift, printed = (float(np.sqrt(np.maximum(0.0, variance))) for variance in variances)
        return total, noise, drift, printed


def physical_parameters(
    model: Model, base: FloatArray, covariances: Covariances, refused: Mapping[str, str]
) -> tuple[tuple[Parameter, ...], dict[str, str]]:
    """Return the physical parameters and, for those that cannot be had, the reason.

    Parameters
    ----------
    model : Model
    base : array, shape (columns,)
        Base parameters, NaN where not identified: what depends on one of them becomes NaN, too.
    covariances : Covariances
        Carried through to first order (delta method).
    refused : mapping of str to str
        Base parameters that were refused, with the reason.
    """
    found, unanswered = [], {}
    for name, value in model.physical_from_base(base).items():
        if np.isfinite(value):
            spreads = covariances.standard_deviations(_gradient(model, base, name))
            found.append(Parameter(name, model.units.get(name, ""), float(value), *spreads))
        elif name not in refused:
            unanswered[name] = f"depends on {', '.join(refused)}, which the records cannot answer"
    return tuple(found), unanswered


def _gradient(model: Model, base: FloatArray, name: str) -> FloatArray:
    """Return the derivatives of a physical parameter by the identified base parameters."""
    identified = np.flatnonzero(np.isfinite(base))
    gradient = np.zeros(len(identified))
    for index, column in enumerate(identified):
        step = RELATIVE_STEP * abs(float(base[column])) or RELATIVE_STEP
        ends = []
        for sign in (1.0, -1.0):
            moved = base.copy()
            moved[column] += sign * step
            ends.append(model.physical_from_base(moved)[name])
        gradient[index] = (ends[0] - ends[1]) / (2.0 * step)
    return gradient
