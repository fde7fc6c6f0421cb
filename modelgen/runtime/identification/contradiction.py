"""Where two estimates of the same columns, or one and what signs are possible, differ beyond noise."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.parameter_checks import negative_value
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.thresholds import BEYOND_CHANCE, DISAGREEMENT
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import negative_columns


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

    `drift` is the covariance of the columns by settings, shape (c, c), in SI.
    """
    negative = negative_columns(model, fit)
    if not negative:
        return {}
    spread = np.sqrt(np.diag(hac_covariance(fit)) + np.diag(drift))
    stds = dict(zip(fit.columns, spread.tolist(), strict=True))
    return {name: -value / stds[name] for name, value in negative.items() if stds[name] > 0.0}


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
    said = (negative_value(model, name, values[name], deviations) for name, deviations in certain.items())
    return replace(found, drift=wider, advice=(*found.advice, *said))
