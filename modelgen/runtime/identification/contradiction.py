"""Where two estimates of the same columns, or one and what signs are possible, differ beyond noise."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.parameter_checks import negative_value
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.thresholds import DISAGREEMENT
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import negative_columns, negative_parameters
from modelgen.runtime.parameters.thresholds import BEYOND_CHANCE


def contradiction(fit: Fit, other: Fit, share: float = 1.0) -> FloatArray:
    """Return by how much two fits to the same columns differ where noise does not explain it, else 0, (c,).

    The noise is that of all samples, of which the fits have a `share`: more than that is in their difference,
    and what they differ by counts as certain.

    What one of them hardly determines (friction of two bodies that a simulation moves as one) is no
    contradiction.
    """
    move = fit.solution.x - other.solution.x
    variance = share * (np.diag(hac_covariance(fit)) + np.diag(hac_covariance(other)))
    return np.where(np.abs(move) > DISAGREEMENT * np.sqrt(np.maximum(variance, 0.0)), move, 0.0)


def below_zero(model: Model, fit: Fit, drift: FloatArray) -> dict[str, float]:
    """Return by how many standard deviations columns are negative that cannot be.

    Of a fit in physical parameters, these. `drift` is the covariance of the columns by settings, shape
    (c, c), in SI.
    """
    physical = fit.physical(model.parameters)
    negative = negative_columns(model, fit) if physical is None else negative_parameters(model, physical)
    if not negative:
        return {}
    covariance = hac_covariance(fit) + drift
    if physical is None:
        stds = dict(zip(fit.columns, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    else:
        stds = _physical_deviations(model, fit, physical, covariance)
    return {name: -value / stds[name] for name, value in negative.items() if stds.get(name, 0.0) > 0.0}


def impossible(model: Model, fit: Fit) -> bool:
    """Tell whether something that cannot be negative is, beyond chance."""
    none = np.zeros((len(fit.columns),) * 2)
    return max(below_zero(model, fit, none).values(), default=0.0) > BEYOND_CHANCE


def _physical_deviations(
    model: Model, fit: Fit, physical: Mapping[str, float], covariance: FloatArray
) -> dict[str, float]:
    """Return standard deviations (SI) of physical parameters from the covariance of columns, shape (c, c)."""
    place = [model.base_parameters.index(name) for name in fit.columns]
    rows = np.sqrt(np.maximum(np.diag(covariance), float(np.finfo(float).tiny)))
    sizes = np.array([abs(physical[name]) or 1.0 for name in model.parameters])
    slope = model.base_jacobian(physical)[place] * sizes / rows[:, None]
    by_column = np.linalg.pinv(slope) * sizes[:, None] / rows
    variances = np.einsum("ij,jk,ik->i", by_column, covariance, by_column)
    return dict(zip(model.parameters, np.sqrt(np.maximum(variances, 0.0)).tolist(), strict=True))


def with_impossible_signs(model: Model, found: Explained, refused: Container[str]) -> Explained:
    """Return what was found, with signs told that cannot be, and intervals that hold them.

    What is negative by many of its standard deviations, and cannot be, shows that all of these are too small:
    they are multiplied by what would make that one likely. What is refused shows nothing.
    """
    below = below_zero(model, found.fit, found.drift)
    certain = {
        name: deviations
        for name, deviations in below.items()
        if deviations >= BEYOND_CHANCE and name not in refused
    }
    if not certain:
        return found
    wider = found.drift + (0.5 * max(certain.values())) ** 2 * (hac_covariance(found.fit) + found.drift)
    values = dict(zip(found.fit.columns, found.fit.solution.x.tolist(), strict=True))
    values |= found.fit.physical(model.parameters) or {}
    said = (negative_value(model, name, values[name], deviations) for name, deviations in certain.items())
    return replace(found, drift=wider, advice=(*found.advice, *said))
