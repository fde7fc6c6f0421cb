"""From a fit to an Estimate: covariances, physical parameters, pruning, and how every row did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.identification.thresholds import LARGEST_PERCENT, NOTED_DRIFT, NOTED_SHARE
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, printed_covariance
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.chain_of_fit import chain_of_fit
from modelgen.runtime.parameters.known_sums import with_known_sums
from modelgen.runtime.parameters.other_solutions import holding, other_solutions, solution_notes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import (
    Covariances,
    FoundParameters,
    all_from_composites,
    hanging_on,
    physical_parameters,
)
from modelgen.runtime.parameters.pruning import Pruning, prune
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import (
    EstimatedFit,
    EstimatedModel,
    EstimatedParameters,
    RowDiagnostics,
)
from modelgen.runtime.results.source import EstimateSource
from modelgen.runtime.rows.observation import Observation


@dataclass(frozen=True, eq=False)
class Solved:
    """A job done: rows, fit, what the records cannot answer, and X's mean square drift, shape (c, c).

    `fixed` holds values that were not fitted (parameters at their bounds), `keep` names that pruning spares.
    """

    job: Job
    method: Method
    observation: Observation
    fit: Fit
    refused: Mapping[str, str]
    drift: FloatArray
    fixed: Mapping[str, float] = field(default_factory=dict)
    keep: tuple[str, ...] = ()

    @cached_property
    def identified(self) -> tuple[str, ...]:
        """Columns of the fit that are estimates, not nuisances."""
        return tuple(name for name in self.fit.columns if name not in self.refused)

    @property
    def nuisance(self) -> dict[str, float]:
        """Values of base parameters that are no estimates: at their bounds, or refused."""
        base = self.job.model.base_parameters
        values = dict(zip(self.fit.columns, self.fit.solution.x.tolist(), strict=True))
        left = {name: value for name, value in values.items() if name not in self.identified}
        return {name: value for name, value in self.fixed.items() if name in base} | left


def judge(solved: Solved, residual_dof: str, checks: CheckOptions) -> Estimate:
    """Return the estimate with everything that is needed to judge it."""
    model, fit, identified, method = solved.job.model, solved.fit, solved.identified, solved.method
    place = [fit.columns.index(name) for name in identified]
    sigma, printed = printed_covariance(fit, residual_dof)
    noise = hac_covariance(fit) if method.covariance_kind == "hac" else printed
    block = np.ix_(place, place)
    covariances = Covariances(
        noise[block] + solved.drift[block], noise[block], solved.drift[block], printed[block]
    )
    values = fit.solution.x[place]
    parameters = _parameters(model, identified, values, covariances)
    base = np.full(len(model.base_parameters), np.nan)
    base[[model.base_parameters.index(name) for name in identified]] = values
    others = fit.carried.others if fit.carried else ()
    found = holding(_physical(solved, base, covariances), others, LARGEST_PERCENT)
    if checks.other_solutions and not others:
        others = other_solutions(model, base, covariances, found.parameters)
    in_memory = all(block.in_memory for block in fit.blocks)
    described = EstimatedFit(
        method=solved.method.name,
        method_title=method.title,
        covariance_kind=method.covariance_kind,
        filtering=solved.job.choice,
        rows=row_diagnostics(solved.observation, fit),
        residuals=tuple(zip(fit.weights, fit.residuals, strict=True)) if in_memory else None,
        condition_number=fit.solution.condition_number,
        condition_number_raw=fit.solution.condition_number_raw,
        relative_error=fit.relative_error,
        error_norm=fit.residual_norm,
        sigma=sigma,
        residual_dof=residual_dof,
        pruning=_prune(solved, residual_dof, checks.prune_percent),
        delays={channel: value for channel, value, _ in fit.delays},
        delay_std={channel: std for channel, _, std in fit.delays},
        notes=solved.observation.notes
        + fit.notes
        + (() if method.consistent else drift_notes(parameters))
        + found.notes
        + solution_notes(others),
    )
    known = chain_of_fit(model, fit, noise + solved.drift, covariances, base, found, solved.fixed)
    return Estimate(
        _described(model),
        tuple(record.name for record in solved.job.records),
        described,
        covariances,
        EstimatedParameters(
            parameters,
            found.parameters,
            base,
            solved.nuisance,
            {**model.absent, **solved.refused, **found.unanswered},
            others,
        ),
        source=EstimateSource(model, solved.job.records, known),
    )


def _parameters(
    model: Model, names: tuple[str, ...], values: FloatArray, covariances: Covariances
) -> tuple[Parameter, ...]:
    """Return the identified base parameters, values of shape (names,), with their standard deviations."""
    each = np.eye(len(names))
    return tuple(
        Parameter(
            name, model.units.get(name, ""), float(values[i]), *covariances.standard_deviations(each[i])
        )
        for i, name in enumerate(names)
    )


def _described(model: Model) -> EstimatedModel:
    symbols = {name: formula for name, formula in model.composites.items() if name != formula}
    roles = {name: entry.role for name, entry in model.roles.items()}
    unseen, known = tuple(model.absent), dict(model.known)
    return EstimatedModel(
        model.chain,
        model.sensor_set,
        model.title,
        symbols,
        roles,
        unseen,
        known,
        groupings=dict(model.groupings),
    )


def _physical(solved: Solved, base: FloatArray, covariances: Covariances) -> FoundParameters:
    """Return the physical parameters that follow, and for the others the reason why they do not."""
    model, fit = solved.job.model, solved.fit
    every = physical_parameters(
        model, base, covariances, solved.refused, solved.nuisance, fit.physical(model.parameters)
    )
    found = {entry.name: entry.value for entry in every.parameters}
    # what lies at its bound has its reason already
    free = tuple(entry for entry in every.parameters if entry.name not in solved.fixed)
    physical, doubtful = certain(free, nonlinear=bool(model.composites))
    known = [name for name in model.base_parameters if name in solved.identified]
    if (
        doubtful
        and all_from_composites(model)
        and list(found) == list(model.parameters)
        and {*known, *solved.fixed} >= {*model.base_parameters}
    ):
        reason = f"cannot be distinguished from {', '.join(doubtful)}, too uncertain in these records"
        hanging = hanging_on(model, covariances, found, doubtful, known)
        doubtful |= dict.fromkeys((name for name in hanging if name not in solved.fixed), reason)
        physical = tuple(entry for entry in physical if entry.name not in doubtful)
    doubtful = with_known_sums(model, covariances, every, doubtful)
    return replace(every, parameters=physical, unanswered={**every.unanswered, **doubtful})


def certain(physical: tuple[Parameter, ...], nonlinear: bool) -> tuple[tuple[Parameter, ...], dict[str, str]]:
    """Return the physical parameters that are certain enough, and for the others the reason.

    What comes out of composites by a nonlinear step has an interval only while its deviation is small.
    """
    doubtful = {
        entry.name: f"its standard deviation is {entry.relative_std:.3g} % of its value, too much for the "
        f"step from the composites ({LARGEST_PERCENT:g} % at most)"
        for entry in physical
        if nonlinear and not entry.relative_std <= LARGEST_PERCENT
    }
    return tuple(entry for entry in physical if entry.name not in doubtful), doubtful


def row_diagnostics(observation: Observation, fit: Fit) -> tuple[RowDiagnostics, ...]:
    """Return how every row did on every record, rows without samples included."""
    solved = {(block.record, block.row): index for index, block in enumerate(fit.blocks)}
    found = []
    for block in observation.blocks:
        index = solved.get((block.record, block.row))
        weight, rms, error = 0.0, None, None
        if index is not None:
            weight, rms, error = fit.weights[index], fit.rms(index), fit.unexplained(index)
        used = block.count
        found.append(
            RowDiagnostics(
                block.record_name, block.row_name, block.unit, used, block.masked, weight, rms, error
            )
        )
    return tuple(found)


def _prune(solved: Solved, residual_dof: str, percent: float) -> Pruning:
    """Apply the paper's rule; columns that are not identifiable stay in as nuisances."""
    fit, identified = solved.fit, solved.identified
    hac = solved.method.covariance_kind == "hac"
    drifts = dict(zip(fit.columns, np.diag(solved.drift).tolist(), strict=True))

    if fit.carried is not None:
        # fitted in the physical parameters: without one of its composites the fit would be another model's
        place = [fit.columns.index(name) for name in identified]
        found = fit.solution.x[place]
        spread = 100.0 * np.sqrt(np.diag(hac_covariance(fit) + solved.drift))[place] / np.abs(found)
        kept = tuple(zip(identified, found.tolist(), spread.tolist(), strict=True))
        return Pruning(percent, fit.relative_error, (), kept)

    def fit_again(kept: tuple[str, ...]) -> tuple[FloatArray, FloatArray, float]:
        columns = [name for name in fit.columns if name in kept or name not in identified]
        reduced = fit
        if len(columns) < len(fit.columns):
            reduced = refit(fit, columns, polish=False)
            reduced = solved.method.finish(reduced, solved.job.model)
        covariance = hac_covariance(reduced) if hac else printed_covariance(reduced, residual_dof)[1]
        place = [reduced.columns.index(name) for name in kept]
        variance = np.diag(covariance)[place] + np.array([drifts[name] for name in kept])
        values = reduced.solution.x[place]
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.nan_to_num(100.0 * np.sqrt(variance) / np.abs(values), nan=np.inf, posinf=np.inf)
        return values, spread, reduced.relative_error

    return prune(identified, fit_again, percent, solved.keep)


def drift_notes(parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """Return a note on the parameters that settings move by more than the residual explains."""
    drifting = [
        entry
        for entry in parameters
        if entry.value
        and entry.drift_std > max(NOTED_DRIFT * entry.noise_std, NOTED_SHARE * abs(entry.value))
    ]
    if not drifting:
        return ()
    listed = ", ".join(
        f"{entry.name} {100.0 * entry.drift_std / abs(entry.value):.2g} %" for entry in drifting
    )
    return (
        "other cut-offs, weights, timings or zeros move the estimate by more than its residual explains "
        f"({listed}): noise in the sensors, or dynamics that the model lacks; the intervals include it",
    )
