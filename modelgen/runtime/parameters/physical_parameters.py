"""From the base parameters that were identified to the physical ones, with their standard deviations.

Where base parameters are composites (an elimination), there may be more of them than physical ones: these are
then the weighted nonlinear least-squares fit to the composites. Covariances are carried on to first order.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.frozen_values import FrozenValues
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.thresholds import (
    CONVERGED,
    HANGING_SHARE,
    NULL_SHARE,
    RANK_TOLERANCE,
    RELATIVE_STEP,
    SMALL_STEP,
    SMALLEST_SPREAD,
    STEPS,
)

# Relative steps below this are taken as they are: whether the misfit falls is a matter of rounding by then.
NO_CHAIN = "the composites are far from those of any chain, so that no physical parameters follow"


@dataclass(frozen=True, eq=False)
class Covariances(FrozenValues):
    """Covariances of the identified base parameters, shape (identified, identified) each.

    `total` is the sum of `noise` (residuals) and `drift` (settings); `printed` is the paper's, eq. (11).
    """

    total: FloatArray
    noise: FloatArray
    drift: FloatArray
    printed: FloatArray

    def standard_deviations(self, gradient: FloatArray) -> tuple[float, float, float, float]:
        """Return those of a function with this gradient, to first order, in the order of the attributes.

        `gradient` is by the identified parameters, shape (identified,).
        """
        variances = [
            gradient @ matrix @ gradient for matrix in (self.total, self.noise, self.drift, self.printed)
        ]
        total, noise, drift, printed = (float(np.sqrt(np.maximum(0.0, variance))) for variance in variances)
        return total, noise, drift, printed


@dataclass(frozen=True, eq=False)
class PhysicalSolution:
    """Values of physical parameters, their gradients by the identified base ones, and which are determined.

    `misfit` is the weighted sum of squares that the composites leave, zero where they only just suffice.
    """

    values: Mapping[str, float]
    gradients: Mapping[str, FloatArray]
    determined: frozenset[str]
    misfit: float


def physical_parameters(
    model: Model,
    base: FloatArray,
    covariances: Covariances,
    refused: Mapping[str, str],
    nuisance: Mapping[str, float],
    near: Mapping[str, float] | None = None,
) -> tuple[tuple[Parameter, ...], dict[str, str]]:
    """Return the physical parameters and, for those that cannot be had, the reason.

    Parameters
    ----------
    model : Model
    base : array, shape (columns,)
        Base parameters, NaN where not identified.
    covariances : Covariances
        Of those identified.
    refused : mapping of str to str
        Base parameters that were refused, with the reason.
    nuisance : mapping of str to float
        Their values in the fit, where they have one: a start for the iteration, no more.
    near : mapping of str to float, optional
        Physical parameters that the fit was made in, if it was: with all base parameters identified they are
        those that belong to them. Else a start where the model's own formula, which works in logarithms,
        leads to none because one of them is below zero.
    """
    if all_from_composites(model) and near is not None and np.isfinite(base).all():
        # they and their covariance came from physical parameters: any weights lead back to the same
        solved = fit_composites(model, base, np.diag(np.where(base == 0.0, 1.0, base**2)), near)
    elif all_from_composites(model):
        start = model.physical_from_base(_filled(model, base, nuisance))
        if near is not None and not _is_start(start, near):
            start = dict(near)
        if not np.isfinite(list(start.values())).all():
            return (), dict.fromkeys(model.identifiable, NO_CHAIN)
        solved = fit_composites(model, base, covariances.total, start)
    else:
        solved = _direct(model, base)
    found, unanswered = [], {}
    for name in model.identifiable:
        if name in solved.determined:
            spreads = covariances.standard_deviations(solved.gradients[name])
            found.append(Parameter(name, model.units.get(name, ""), solved.values[name], *spreads))
        elif name not in refused:
            unanswered[name] = _why_open(refused)
    return tuple(found), unanswered


def _why_open(refused: Collection[str]) -> str:
    if not refused:
        return "cannot be worked out from the base parameters found: they leave it open"
    return f"depends on {', '.join(refused)}, which the records cannot answer"


def _is_start(start: Mapping[str, float], near: Mapping[str, float]) -> bool:
    return all(np.isfinite(value) and not near[name] < 0.0 <= value for name, value in start.items())


def hanging_on(
    model: Model,
    covariances: Covariances,
    values: Mapping[str, float],
    doubtful: Collection[str],
    known: Sequence[str],
) -> tuple[str, ...]:
    """Return the physical parameters that are little known without knowing the doubtful ones.

    They move with the doubtful ones wherever these turn out to be, far from where the formulas are linear.

    Parameters
    ----------
    covariances : Covariances
        Of the base parameters in `known`.
    values : mapping of str to float
        Of all physical parameters.
    doubtful : collection of str
        Those that are too uncertain.
    known : sequence of str
        Base parameters with a number, in the model's order; the others are zero.
    """
    size = np.array([abs(values[name]) or 1.0 for name in model.parameters])
    rows = [model.base_parameters.index(name) for name in known]
    # how noise couples them: drift moves all along one direction, coupled or not
    weighted = _whitening(covariances.noise) @ model.base_jacobian(values)[rows] * size
    inverse = np.linalg.pinv(weighted, rcond=RANK_TOLERANCE)
    C = inverse @ inverse.T
    lost = [index for index, name in enumerate(model.parameters) if name in doubtful]
    share = C[:, lost] @ np.linalg.pinv(C[np.ix_(lost, lost)]) @ C[lost]
    explained = np.diag(share) > HANGING_SHARE * np.diag(C)
    return tuple(
        name
        for name, hangs in zip(model.parameters, explained, strict=True)
        if hangs and name not in doubtful
    )


def all_from_composites(model: Model) -> bool:
    """Tell whether the base parameters are composites that determine every physical parameter."""
    return bool(model.composites) and len(model.identifiable) == len(model.parameters)


def _direct(model: Model, base: FloatArray) -> PhysicalSolution:
    """Take the model's own formula; what it makes of a base parameter not identified does not count."""
    identified = np.flatnonzero(np.isfinite(base))
    names = [model.base_parameters[index] for index in identified]
    # without composites the formula passes a NaN on; otherwise only what is a base parameter itself is safe
    safe = names if model.composites and len(names) < len(base) else model.identifiable
    filled = np.where(np.isfinite(base), base, 0.0) if model.composites else base
    values = model.physical_from_base(filled)
    determined = [name for name in model.identifiable if name in safe and np.isfinite(values[name])]
    return PhysicalSolution(
        values, _differences(model, filled, identified, determined), frozenset(determined), 0.0
    )


def _differences(
    model: Model, base: FloatArray, identified: npt.NDArray[np.intp], names: list[str]
) -> dict[str, FloatArray]:
    """Return the derivatives of the model's formula by the identified base parameters."""
    gradients = {name: np.zeros(len(identified)) for name in names}
    for index, column in enumerate(identified):
        step = RELATIVE_STEP * abs(float(base[column])) or RELATIVE_STEP
        ends = []
        for sign in (1.0, -1.0):
            moved = base.copy()
            moved[column] += sign * step
            ends.append(model.physical_from_base(moved))
        for name in names:
            gradients[name][index] = (ends[0][name] - ends[1][name]) / (2.0 * step)
    return gradients


def _filled(model: Model, base: FloatArray, nuisance: Mapping[str, float]) -> FloatArray:
    """Return the base parameters with the fit's own values in place of those not identified."""
    filled = base.copy()
    for index in np.flatnonzero(np.isnan(base)):
        filled[index] = nuisance.get(model.base_parameters[index], 0.0)
    return filled


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
    whiten = _whitening(covariance)

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
    determined = [name for name, known in zip(model.parameters, _known(weighted), strict=True) if known]
    return PhysicalSolution(
        dict(zip(model.parameters, p.tolist(), strict=True)),
        dict(zip(model.parameters, gradients, strict=True)),
        frozenset(determined),
        float(error @ error),
    )


def _smaller(error: FloatArray, than: FloatArray) -> bool:
    return bool(error @ error < than @ than)


def _known(slope: FloatArray) -> list[bool]:
    """Tell which parameters take no part in a direction that leaves all base parameters as they are."""
    _, s, Vt = np.linalg.svd(slope, full_matrices=True)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0]))
    return [bool(known) for known in np.all(np.abs(Vt[rank:]) < NULL_SHARE, axis=0)]


def _whitening(covariance: FloatArray) -> FloatArray:
    """Return V with V C V^T = 1, except where C is next to nothing: there V is kept from exploding."""
    spread = np.sqrt(np.diag(covariance))
    spread = np.where(spread > 0.0, spread, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    floor = SMALLEST_SPREAD**2 * max(float(values[-1]), 1.0)
    return np.asarray((vectors / np.sqrt(np.maximum(values, floor))).T / spread)
