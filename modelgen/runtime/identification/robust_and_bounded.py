"""What is done to a method's fit before it is judged: columns left out at their bounds, robust weights.

A fit of physical parameters to rows of composites is treated while it is found (`physical_iv`): its rows are
linear at the estimate only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from modelgen.errors import Problem
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.huber import huber, huber_notes
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import PHYSICAL, BoundCost, bounded_fit, bounded_physical
from modelgen.runtime.parameters.consistent_fit import among_bodies, consistent_fit

HUBER = "huber"
# Methods whose fit is a (weighted, projected) least-squares problem that robust weights and bounds can enter.
TREATABLE = ("auto", "wls", "iv")


def treatment_problems(method: str, robust: str | None, bounds: str | None) -> list[Problem]:
    """Return one problem for every word that is unknown, or does not go with the method."""
    problems = []
    for name, given, word in (("robust", robust, HUBER), ("bounds", bounds, PHYSICAL)):
        if given is None:
            continue
        if given != word:
            problems.append(Problem(name, f"is {given!r}", f'give "{word}", or nothing'))
        if method not in TREATABLE:
            what = f"does not go with method {method}"
            problems.append(Problem(name, what, f"use one of {', '.join(TREATABLE)}"))
    return problems


@dataclass(frozen=True)
class Treatment:
    """The same for the fit and for those at other settings, so that they can be compared.

    `columns` are those left free by the bounds, None for all; `robust` is "huber" or None. `at_zero` are
    physical parameters that bounds hold at zero, of a fit that is treated while it is found. The links of the
    arm `arm` are kept bodies.
    """

    robust: str | None = None
    columns: tuple[str, ...] | None = None
    at_zero: tuple[str, ...] = ()
    arm: Model | None = None

    def __call__(self, fit: Fit) -> Fit:
        """Return the fit so treated."""
        if fit.carried is not None:
            return fit
        found = fit
        if self.columns is not None and self.columns != fit.columns:
            there = [name for name in self.columns if name in fit.columns]
            found = replace(refit(fit, there), notes=fit.notes, delays=fit.delays)
        if self.robust is not None:
            found, weights = huber(found)
            found = replace(found, notes=found.notes + huber_notes(weights))
        return found if self.arm is None else among_bodies(found, self.arm)[0]

    def job(self, job: Job) -> Job:
        """Return the job whose fits hold at zero what lies at its bound, whatever they find themselves."""
        return replace(job, bounds=None, at_zero=self.at_zero)


def treat(
    fit: Fit, model: Model, robust: str | None, bounds: str | None
) -> tuple[Fit, Treatment, BoundCost | None]:
    """Return the treated fit, what was done to it, and what bounds cost (None without any)."""
    if fit.carried is not None:
        linear = fit.carried.linear
        cost = bounded_physical(linear, model, hac_covariance(linear))[1] if bounds else None
        return fit, Treatment(at_zero=tuple(name for name, _ in cost.active) if cost else ()), cost
    treatment = Treatment(robust)
    found = treatment(fit)
    if bounds is None:
        return found, treatment, None
    if model.is_arm:
        within, cost = consistent_fit(found, model)
    else:
        within, cost = bounded_fit(found, model, hac_covariance(found))
    if not cost.active and not cost.held:
        return found, treatment, cost
    treatment = Treatment(robust, within.columns, arm=model if model.is_arm else None)
    return treatment(fit), treatment, cost


def unweighted(fit: Fit, plain: Fit) -> Fit:
    """Return a treated fit on the rows as they were, without robust weights."""
    if fit is plain:
        return fit
    blocks, projected = plain.rows(fit.columns)
    residuals = tuple(block.residual(fit.solution.x) for block in blocks)
    return replace(fit, blocks=blocks, projected=projected, residuals=residuals, weights=plain.weights)
