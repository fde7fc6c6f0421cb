"""Guards and tests around a fit: what gets no number, what widens the intervals, what a user should know."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, IdentifiabilityError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.filter_scan import FilterScan, scan_filters, scanned_settings
from modelgen.runtime.diagnostics.hold_out import HeldOut, held_out, hold_out_advice
from modelgen.runtime.diagnostics.motion_checks import (
    band_above_filter,
    friction_and_offset,
    one_way_advice,
    one_way_columns,
    one_way_friction,
    resting_bodies,
    resting_records,
    short_records,
)
from modelgen.runtime.diagnostics.noise_bias import bias_advice, lost_in_noise, noise_bias, significant_bias
from modelgen.runtime.diagnostics.parameter_checks import (
    dependence_advice,
    negative_values,
    noisy_derivatives,
    null_solution,
    slowest_mode_hz,
    uncertain_parameters,
)
from modelgen.runtime.diagnostics.periods import (
    PeriodSpread,
    period_advice,
    period_spread,
    spread_beyond_noise,
)
from modelgen.runtime.diagnostics.residual_tests import residual_advice, residual_tests
from modelgen.runtime.diagnostics.unit_errors import unlike_nominal
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, decimation_for
from modelgen.runtime.filter_choice.signal_to_noise import signal_to_noise
from modelgen.runtime.identification.methods import METHODS, Job, Method
from modelgen.runtime.identification.robust_and_bounded import Treatment
from modelgen.runtime.identification.swapped_channels import swapped_channels
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import BoundCost, bound_advice
from modelgen.runtime.parameters.dependence import HIGHEST_INDEX, LARGEST_INDEX, dependences
from modelgen.runtime.parameters.unanswered_columns import not_identifiable
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.checks import Checks, Periods
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.paper_rows import observe_paper

FloatArray = npt.NDArray[np.float64]

# Columns that move together leave a parameter without a number from this relative standard deviation in % on.
WITHOUT_NUMBER_PERCENT = 100.0


@dataclass(frozen=True, eq=False)
class Extras:
    """What was found beside the fit, see `Checks`; `bias` is that by noise, of least squares only."""

    periods: PeriodSpread | None = None
    held_out: HeldOut | None = None
    scan: FilterScan | None = None
    bounds: BoundCost | None = None
    bias: FloatArray | None = None


def refusals(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, keep: Sequence[str]
) -> tuple[dict[str, str], tuple[Advice, ...]]:
    """Return the columns that get no number, with the reason, and advice on those kept in spite of one.

    `keep` overrules what is a judgement (friction without steady motion, encoder zeros, near dependence);
    nothing overrules a column that is zero or exactly dependent.

    Raises
    ------
    DataError
        For a name to keep that is no base parameter.
    """
    unknown = [name for name in keep if name not in model.base_parameters]
    if unknown:
        raise DataError(*(missing_name("keep", "parameter", name, model.base_parameters) for name in unknown))
    reasons = not_identifiable(model, records, choice, fit) | one_way_columns(model, fit.absent)
    reasons |= dependent_columns(fit, reasons) | resting_bodies(model, records)
    reasons |= friction_and_offset(model, one_way_friction(model, fit), fit.columns)
    lost = {*fit.absent, *_undetermined(fit)}
    insisted = [name for name in keep if name in reasons and name not in lost]
    advice = tuple(
        Advice("kept on request", name, f"has a number although {reasons[name]}", "do not rely on it")
        for name in insisted
    )
    refused = {name: reasons[name] for name in model.base_parameters if name in reasons}
    return {name: reason for name, reason in refused.items() if name not in insisted}, advice


def late_refusals(
    fit: Fit,
    refused: Mapping[str, str],
    drift: FloatArray,
    keep: Sequence[str],
    bias: FloatArray | None = None,
) -> dict[str, str]:
    """Return what is refused once drift and bias are known: not all that is left, though."""
    found = dependent_columns(fit, refused, drift) | (lost_in_noise(fit, bias) if bias is not None else {})
    late = {name: reason for name, reason in found.items() if name not in refused and name not in keep}
    left = [name for name in fit.columns if name not in refused and name not in late]
    return {**refused, **late} if left else dict(refused)


def all_refused(refused: Mapping[str, str]) -> IdentifiabilityError:
    """Return the error that says that no parameter gets a number, with every reason."""
    remedy = "record another motion, or sense more"
    return IdentifiabilityError(*(Problem(name, reason, remedy) for name, reason in refused.items()))


def judge_held_out(
    job: Job, method: str, fit: Fit, refused: Mapping[str, str], held: Sequence[Record], treatment: Treatment
) -> HeldOut | None:
    """Return how a fit does on records it has not seen; None without any. Raises DataError if too short."""
    if not held:
        return None
    decimation = tuple(decimation_for(record.fs, job.choice.cutoff_hz) for record in held)
    tags = [record.tag for record in held]
    rows = None if job.rows_for_tag is None else {t: r for t, r in job.rows_for_tag.items() if t in tags}
    choice = replace(job.choice, decimation=decimation)
    apart = replace(job, records=tuple(held), choice=choice, late=(), rows_for_tag=rows)
    try:
        observation, own = METHODS[method].run(apart)
        return held_out(fit, refused, observation, treatment(own))
    except IdentifiabilityError:  # they cannot answer for themselves, but can be looked at
        watch = observe if METHODS[method].matched else observe_paper
        observation = watch(job.model, held, choice, job.drop)
        return held_out(fit, refused, apart.only_rows_for_tag(observation), None)


def periods_found(
    fit: Fit, records: Sequence[Record], choice: FilterChoice, period_s: Mapping[str, float]
) -> PeriodSpread | None:
    """Return the spread over periods where every record has some."""
    return period_spread(fit, records, choice.decimation, period_s) if period_s else None


def scanned(
    fit: Fit,
    choice: FilterChoice,
    records: Sequence[Record],
    cutoffs_hz: Sequence[float] | str | None,
    again: Callable[[FilterChoice], Fit],
    refused: Mapping[str, str],
    say: Callable[[str], None],
) -> FilterScan | None:
    """Return the scan over filters that was asked for; see `modelgen.runtime.diagnostics.filter_scan`."""
    if cutoffs_hz is None:
        return None
    settings = scanned_settings(choice, records, cutoffs_hz)
    say("scanning filters")
    return scan_filters(fit, choice, settings, again, [name for name in fit.columns if name not in refused])


def more_than_noise(fit: Fit, extras: Extras) -> FloatArray:
    """Return what periods, held-out records and bias by noise add to X's mean square error, shape (c, c)."""
    total = np.zeros((len(fit.columns), len(fit.columns)))
    if extras.periods is not None:
        total += spread_beyond_noise(extras.periods, hac_covariance(fit))
    if extras.held_out is not None:
        total += extras.held_out.drift(fit.columns)
    if extras.bias is not None:
        bias = significant_bias(fit, extras.bias, hac_covariance(fit))
        total += np.outer(bias, bias)
    return total


def bias_of(method: Method, job: Job, fit: Fit) -> FloatArray | None:
    """Return how far noise pulls the estimate where the method is least squares, else None."""
    least_squares = method.matched and not method.consistent and method.finish is None
    return noise_bias(job.model, job.records, job.choice, fit) if least_squares else None


def examine(
    estimate: Estimate,
    job: Job,
    fit: Fit,
    drift: FloatArray,
    refused: Mapping[str, str],
    period_s: Mapping[str, float],
    extras: Extras,
    advice: Sequence[Advice],
    keep: Sequence[str],
) -> Checks:
    """Return all checks of an estimate and of the fit behind it."""
    model, records, choice = job.model, job.records, job.choice
    method, percent = METHODS[estimate.method], estimate.pruning.percent
    noise = hac_covariance(fit)
    signals = signal_to_noise(model, records, choice)
    residuals = residual_tests(model, records, choice, fit, period_s) if method.matched else ()
    slowest_hz = slowest_mode_hz(model, estimate.physical)
    one_way = one_way_friction(model, fit)
    bounds, periods = extras.bounds, extras.periods
    told = (
        *advice,
        *swapped_channels(job, fit),
        *unlike_nominal(model, estimate.physical, estimate.records),
        *resting_records(model, records),
        *one_way_advice(model, one_way, refused),
        *short_records(records, choice, fit, slowest_hz),
        *(() if method.matched else band_above_filter(records, choice)),
        *null_solution(fit, model, records, choice),
        *negative_values(model, estimate.parameters),
        *dependence_advice(
            dependences(fit, noise + drift), estimate.parameters, percent, dependent_columns(fit, (), drift)
        ),
        *uncertain_parameters(model, fit, estimate.parameters, percent, slowest_hz, choice.dynamics_hz),
        *(() if method.consistent else noisy_derivatives(model, signals)),
        *(bias_advice(fit, extras.bias, noise, estimate.parameters) if extras.bias is not None else ()),
        *(bound_advice(bounds) if bounds else ()),
        *(period_advice(periods, noise, fit.columns) if periods else ()),
        *(hold_out_advice(extras.held_out) if extras.held_out else ()),
        *residual_advice(residuals),
    )
    return Checks(
        told,
        residuals,
        signals,
        _periods(periods, fit, estimate),
        extras.held_out,
        extras.scan,
        bounds,
        tuple(keep),
    )


def _periods(found: PeriodSpread | None, fit: Fit, estimate: Estimate) -> Periods | None:
    if found is None:
        return None
    place = [fit.columns.index(entry.name) for entry in estimate.parameters]
    covariance = found.covariance[np.ix_(place, place)].tolist()
    return Periods(found.count, tuple(found.period_s.items()), tuple(tuple(row) for row in covariance))


def _undetermined(fit: Fit) -> list[str]:
    return [name for name, lost in zip(fit.columns, fit.solution.undetermined, strict=True) if lost]


def dependent_columns(
    fit: Fit, otherwise: Container[str] = (), drift: FloatArray | float = 0.0
) -> dict[str, str]:
    """Return the columns without a number because they move with others, exactly or nearly.

    Near dependence counts where it leaves a parameter with a standard deviation above its value, `drift`
    (shape (c, c)) included; columns that are refused `otherwise` are no news then.
    """
    lost = _undetermined(fit)
    if not lost and fit.solution.condition_number < LARGEST_INDEX:
        return {}
    covariance = hac_covariance(fit) + drift
    found: dict[str, str] = {}
    for group in dependences(fit, covariance, HIGHEST_INDEX) if lost else ():
        for name in group.columns:
            if name in lost:
                found[name] = f"cannot be told from {group.others(name)} (W is short of rank)"
    for group in dependences(fit, covariance):
        for name in group.columns:
            index = fit.columns.index(name)
            spread = 100.0 * float(np.sqrt(max(covariance[index, index], 0.0)))
            uncertain = spread > WITHOUT_NUMBER_PERCENT * abs(float(fit.solution.x[index]))
            if uncertain and name not in otherwise and name not in lost:
                index_said = f"condition index {group.condition_index:.0f}"
                found[name] = f"cannot be told from {group.others(name)} in these records ({index_said})"
    return found
