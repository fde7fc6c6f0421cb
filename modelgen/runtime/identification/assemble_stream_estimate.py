"""From the triangles of records to an Estimate: what `judge` and its guards do with the rows themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.diagnostics.motion_checks import resting_bodies
from modelgen.runtime.diagnostics.settings_drift import LOAD_ROW_FACTORS, other_cutoffs, other_direction
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.assemble_estimate import certain, drift_notes
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.least_squares.hac_covariance_chunks import stream_hac_covariance
from modelgen.runtime.least_squares.triangle_fit import FactorFit, fit_factors, refit_factors
from modelgen.runtime.least_squares.wls import LOAD_ROW_SHARE
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.other_solutions import other_solutions, solution_notes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from modelgen.runtime.parameters.pruning import Pruning, prune
from modelgen.runtime.parameters.unanswered_columns import columns_that_vanish, friction_without_steady_motion
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate, RowDiagnostics
from modelgen.runtime.rows.record_factors import RecordFactors
from modelgen.runtime.rows.record_rows import RecordRows

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StreamSolved:
    """What `judge_stream` looks at; `refused` and `drift` are those of `Solved` in `assemble_estimate`."""

    model: Model
    choice: FilterChoice
    tasks: tuple[RecordRows, ...]
    factors: tuple[RecordFactors, ...]
    fit: FactorFit
    refused: Mapping[str, str]
    drift: FloatArray

    def covariance(self, fit: FactorFit) -> FloatArray:
        """Return the HAC covariance; the printed one where there are too many columns for it."""
        if fit.inverse is None:
            return np.diag(fit.sigma**2 * fit.variance)
        return stream_hac_covariance(fit, self.tasks)


def refused_columns(
    model: Model, pieces: Sequence[Record], choice: FilterChoice, fit: FactorFit
) -> dict[str, str]:
    """Return the base parameters that the records cannot answer, with the reason, in the model's order."""
    names = [model.base_parameters[column] for column in fit.columns]
    reasons = {
        name: "its column is zero in every sample used" for name in model.base_parameters if name not in names
    }
    for name, lost in zip(names, fit.undetermined, strict=True):
        if lost:
            reasons[name] = "cannot be told from other parameters in these records (W is short of rank)"
    unsteady = friction_without_steady_motion(model, pieces, choice)
    for found in (columns_that_vanish(model, unsteady), resting_bodies(model, pieces)):
        for name, reason in found.items():
            reasons.setdefault(name, reason)
    return {name: reasons[name] for name in model.base_parameters if name in reasons}


def stream_drift(
    model: Model,
    factors: Sequence[RecordFactors],
    fit: FactorFit,
    choice: FilterChoice,
    lowest_fs: float,
    again: Callable[[FilterChoice], FactorFit],
) -> FloatArray:
    """Return X's mean square drift with cut-offs and with the weight of load rows, shape (c, c).

    As `modelgen.runtime.diagnostics.settings_drift`; `again` fits with other settings, `lowest_fs` is in Hz.
    """
    at_cutoffs = [other for _, other in other_cutoffs(choice, lowest_fs, again)]
    other_directions = other_direction(choice, lowest_fs, again) if model.direction_keys else []
    at_directions = [other for _, other in other_directions]
    at_weights = [
        fit_factors(model, factors, load_row_share=factor * LOAD_ROW_SHARE)
        for factor in (LOAD_ROW_FACTORS if fit.loads else ())
    ]
    total = np.zeros((len(fit.columns), len(fit.columns)))
    for others in (at_cutoffs, at_directions, at_weights):
        moves = [(other.x - fit.x)[list(fit.columns)] for other in others if other.columns == fit.columns]
        for move in moves:
            total += np.outer(move, move) / len(moves)
    return total


def judge_stream(solved: StreamSolved, prune_percent: float) -> Estimate:
    """Return the estimate with everything that is needed to judge it, but the residual."""
    model, fit, method = solved.model, solved.fit, METHODS["wls"]
    names = [model.base_parameters[column] for column in fit.columns]
    place = [index for index, name in enumerate(names) if name not in solved.refused]
    block, columns = np.ix_(place, place), [fit.columns[index] for index in place]
    whole = solved.covariance(fit)
    noise, drift = whole[block], solved.drift[block]
    printed = np.diag(fit.variance) if fit.inverse is None else fit.inverse
    covariances = Covariances(noise + drift, noise, drift, fit.sigma**2 * printed[block])
    unit = np.eye(len(place))
    parameters = tuple(
        Parameter(
            names[index],
            model.units.get(names[index], ""),
            float(fit.x[fit.columns[index]]),
            *covariances.standard_deviations(unit[i]),
        )
        for i, index in enumerate(place)
    )
    base = np.full(len(model.base_parameters), np.nan)
    base[columns] = fit.x[columns]
    nuisance = {
        name: float(fit.x[c]) for name, c in zip(names, fit.columns, strict=True) if np.isnan(base[c])
    }
    found, unanswered = physical_parameters(model, base, covariances, solved.refused, nuisance)
    physical, doubtful = certain(found, nonlinear=bool(model.composites))
    others = other_solutions(model, base, covariances, physical)
    return Estimate(
        chain=model.chain,
        sensor_set=model.sensor_set,
        title=model.title,
        method="wls",
        method_title=method.title,
        records=tuple(task.source.name for task in solved.tasks),
        parameters=parameters,
        physical_parameters=physical,
        covariance=covariances.total,
        noise_covariance=covariances.noise,
        printed_covariance=covariances.printed,
        covariance_kind="printed" if fit.inverse is None else method.covariance_kind,
        base=base,
        nuisance=nuisance,
        not_identifiable={**model.absent, **solved.refused, **unanswered, **doubtful},
        other_solutions=others,
        resid=np.zeros(0),
        residual_count=fit.samples,
        condition_number=fit.condition_number,
        condition_number_raw=fit.condition_number_raw,
        relative_error=fit.relative_error,
        error_norm=fit.residual_norm,
        sigma=fit.sigma,
        residual_dof="r-c",
        delays={},
        rows=_rows(solved),
        pruning=_prune(solved, whole, [entry.name for entry in parameters], prune_percent),
        filtering=solved.choice,
        notes=_runaway_notes(solved) + drift_notes(parameters) + solution_notes(others),
    )


def _rows(solved: StreamSolved) -> tuple[RowDiagnostics, ...]:
    """Return how every row did on every record, rows without samples included."""
    fit, found = solved.fit, []
    for index, record in enumerate(solved.factors):
        for info, factor in zip(solved.model.rows, record.rows, strict=True):
            key = (index, factor.row)
            rms = fit.rms.get(key)
            size = factor.terms_norm(fit.x) if key in fit.loads else factor.force_norm
            error = None if rms is None or size == 0.0 else rms * float(np.sqrt(factor.samples)) / size
            counts = factor.samples, factor.masked
            weight = fit.weights.get(key, 0.0)
            found.append(RowDiagnostics(record.name, info.name, info.unit, *counts, weight, rms, error))
    return tuple(found)


def _prune(solved: StreamSolved, noise: FloatArray, identified: Sequence[str], percent: float) -> Pruning:
    """Apply the paper's rule; columns that are not identifiable stay in as nuisances.

    `noise` is the covariance of the fit to all columns.
    """
    fit, names = solved.fit, solved.model.base_parameters
    drifts = dict(zip(fit.columns, np.diag(solved.drift).tolist(), strict=True))

    def fit_again(kept: tuple[str, ...]) -> tuple[FloatArray, FloatArray, float]:
        columns = [c for c in fit.columns if names[c] in kept or names[c] not in identified]
        fewer = len(columns) < len(fit.columns)
        reduced = refit_factors(solved.factors, fit, columns) if fewer else fit
        place = [columns.index(names.index(name)) for name in kept]
        variance = np.diag(solved.covariance(reduced) if fewer else noise)[place]
        values = reduced.x[[columns[index] for index in place]]
        total = variance + np.array([drifts[columns[index]] for index in place])
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.nan_to_num(100.0 * np.sqrt(total) / np.abs(values), nan=np.inf)
        return values, spread, reduced.relative_error

    return prune(identified, fit_again, percent)


def _runaway_notes(solved: StreamSolved) -> tuple[str, ...]:
    return tuple(
        f"{solved.factors[record].name}, row {solved.model.rows[row].name} holds no force and, weighted by "
        "its residual, would pull its parameters towards zero; its weight is bounded, but noise of the "
        "sensors biases what it decides"
        for record, row in solved.fit.runaways
    )
