"""From the base parameters that were identified to the physical ones, with their standard deviations.

Where base parameters are composites (an elimination), there may be more of them than physical ones: these are
then the nonlinear least-squares fit to the composites, weighted by what noise makes of them. Drift moves all
composites along one direction and says nothing of which to trust: it is carried on, as a covariance of the
result, to first order as that of the noise is. What the fit misses is tested: composites that contradict each
other by more than both explain widen the intervals.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.frozen_values import FrozenValues
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.decorrelation import whitening
from modelgen.runtime.parameters.composite_fit import PhysicalSolution, fit_composites
from modelgen.runtime.parameters.grouped_reasons import DEPENDS
from modelgen.runtime.parameters.nearest_parameters import nearest_parameters
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.robust_starts import robust_starts
from modelgen.runtime.parameters.thresholds import (
    HANGING_SHARE,
    RANK_TOLERANCE,
    RELATIVE_STEP,
    SMALLEST_SPREAD,
)

NO_CHAIN = "the composites are far from those of any chain, so that no physical parameters follow"
CONTRADICTED = (
    "the composites contradict each other by {factor:.2g} times what noise and drift explain: a model error, "
    "or the bias that noise gives least squares; the intervals of the physical parameters are wider by that"
)


@dataclass(frozen=True, eq=False)
class Covariances(FrozenValues):
    """Covariances of the identified base parameters, in SI, shape (identified, identified) each.

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
class FoundParameters:
    """Physical parameters, for those that cannot be had the reason, and what is to be said of them.

    `solution` is the fit to composites behind them, None where there are none; what composites contradict
    each other by widens the intervals by `factor`.
    """

    parameters: tuple[Parameter, ...]
    unanswered: Mapping[str, str]
    notes: tuple[str, ...] = ()
    solution: PhysicalSolution | None = None
    factor: float = 1.0


def physical_parameters(
    model: Model,
    base: FloatArray,
    covariances: Covariances,
    refused: Mapping[str, str],
    nuisance: Mapping[str, float],
    near: Mapping[str, float] | None = None,
    known: Mapping[str, float] | None = None,
) -> FoundParameters:
    """Return the physical parameters and, for those that cannot be had, the reason.

    Parameters
    ----------
    model : Model
    base : array, shape (columns,)
        Base parameters in SI, NaN where not identified.
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
    known : mapping of str to float, optional
        All physical parameters (SI) that were found for the same base parameters with other weights: where
        these lead to a chain from there, no other start is looked for.
    """
    solved, factor = None, 1.0
    if not model.composites:
        values, gradients = _direct(model, base)
    else:
        solved, factor = _from_composites(model, base, covariances, nuisance, near, known)
        if solved is None:
            return FoundParameters((), dict.fromkeys(model.identifiable, NO_CHAIN))
        values, gradients = solved.values, {name: solved.gradients[name] for name in solved.determined}
    found, unanswered = [], {}
    for name in model.identifiable:
        if name in gradients:
            total, noise, drift, printed = covariances.standard_deviations(gradients[name])
            # what composites contradict each other by is no noise of theirs
            drift = float(np.sqrt(drift**2 + (factor**2 - 1.0) * total**2))
            spreads = (factor * total, noise, drift, printed)
            found.append(Parameter(name, model.units.get(name, ""), values[name], *spreads))
        elif name not in refused:
            unanswered[name] = _why_open(refused)
    notes = (CONTRADICTED.format(factor=factor),) if factor > 1.0 else ()
    return FoundParameters(tuple(found), unanswered, notes, solved, factor)


def _from_composites(
    model: Model,
    base: FloatArray,
    covariances: Covariances,
    nuisance: Mapping[str, float],
    near: Mapping[str, float] | None,
    known: Mapping[str, float] | None,
) -> tuple[PhysicalSolution | None, float]:
    """Return the best fit to the composites, None without a start, and by how much they contradict it."""
    if near is not None and np.isfinite(base).all() and all_from_composites(model):
        # they and their covariance came from physical parameters: any weights lead back to the same
        return fit_composites(model, base, np.diag(np.where(base == 0.0, 1.0, base**2)), near), 1.0
    if known is not None:
        found = fit_composites(model, base, covariances.noise, known)
        if not _unsound(model, base, found):
            return found, found.contradiction(covariances.total)
    filled = _filled(model, base, nuisance)
    starts = nearest_parameters(model, filled)
    if near is not None and not (starts and _is_start(starts[0], near)):
        starts = (near,)
    best = _best(model, base, covariances, starts)
    if near is None and _astray(model, base, covariances, best):
        # one composite that noise has bent can lead all starts astray
        std = np.zeros_like(filled)
        std[np.isfinite(base)] = np.sqrt(np.maximum(np.diag(covariances.noise), 0.0))
        best = _best(model, base, covariances, robust_starts(model, filled, std), best)
    return best, 1.0 if best is None else best.contradiction(covariances.total)


def _astray(model: Model, base: FloatArray, covariances: Covariances, found: PhysicalSolution | None) -> bool:
    """Return whether a solution is no chain, is far from the composites, or leaves open what those do."""
    if found is None or _unsound(model, base, found):
        return True
    return found.contradiction(covariances.total) > 1.0


def _unsound(model: Model, base: FloatArray, found: PhysicalSolution) -> bool:
    """Return whether a solution is no chain, or leaves open what all composites determine."""
    whole = all_from_composites(model) and bool(np.isfinite(base).all())
    lacking = whole and len(found.determined) < len(model.parameters)
    return lacking or not _solid(model, found.values)


def _best(
    model: Model,
    base: FloatArray,
    covariances: Covariances,
    starts: Sequence[Mapping[str, float]],
    before: PhysicalSolution | None = None,
) -> PhysicalSolution | None:
    """Return the solution that fits best of those from the starts and of one before, None without any.

    What no chain has comes last, and before it what leaves parameters open: bodies of no size, or of any.
    """
    found = [] if before is None else [before]
    found += [fit_composites(model, base, covariances.noise, start) for start in starts]
    return min(
        found,
        key=lambda one: (not _solid(model, one.values), -len(one.determined), one.misfit),
        default=None,
    )


def _solid(model: Model, values: Mapping[str, float]) -> bool:
    """Return whether inertias and stiffnesses are above zero: other solutions are no chain's."""
    roles = model.roles
    return all(
        value > 0.0
        for name, value in values.items()
        if name in roles and roles[name].role in ("inertia", "stiffness")
    )


def _why_open(refused: Collection[str]) -> str:
    if not refused:
        return "cannot be worked out from the base parameters found: they leave it open"
    return f"{DEPENDS}{', '.join(refused)}, which the records cannot answer"


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
    weighted = whitening(covariances.noise, SMALLEST_SPREAD) @ model.base_jacobian(values)[rows] * size
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
    """Return whether the base parameters are composites that determine every physical parameter."""
    return bool(model.composites) and len(model.identifiable) == len(model.parameters)


def _direct(model: Model, base: FloatArray) -> tuple[Mapping[str, float], dict[str, FloatArray]]:
    """Return what the model's own formula gives, and the gradients; it passes on what is not identified."""
    values = model.physical_from_base(base)
    determined = [name for name in model.identifiable if np.isfinite(values[name])]
    return values, _differences(model, base, np.flatnonzero(np.isfinite(base)), determined)


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
