"""Guards and tests around a fit: what gets no number, what widens the intervals, what a user should know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, shortened
from modelgen.progress import step
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.changing_inertia import (
    ChangingInertia,
    changing_inertia,
    changing_inertia_advice,
)
from modelgen.runtime.diagnostics.filter_scan import FilterScan, scan_filters, scanned_settings
from modelgen.runtime.diagnostics.friction_asymmetry import Asymmetry, asymmetries
from modelgen.runtime.diagnostics.hold_out import HeldOut, hold_out_advice
from modelgen.runtime.diagnostics.motion_checks import (
    band_above_filter,
    one_way_advice,
    one_way_friction,
    resting_records,
    short_records,
)
from modelgen.runtime.diagnostics.noise_bias import bias_advice, noise_bias, significant_bias
from modelgen.runtime.diagnostics.parameter_checks import (
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
from modelgen.runtime.diagnostics.residual_tests import ResidualTest, residual_advice, residual_tests
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.diagnostics.samples.unit_errors import unlike_nominal
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import signal_to_noise
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.refusals import dependent_columns, late_refusals
from modelgen.runtime.identification.solution import Solution, on_unseen
from modelgen.runtime.identification.swapped_channels import or_swapped, swapped_channels
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import CALM
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.threads import meanwhile
from modelgen.runtime.parameters.bounds import BoundCost, bound_advice
from modelgen.runtime.parameters.dependence import dependence_advice, dependences
from modelgen.runtime.results.checks import Checks, Periods
from modelgen.runtime.results.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Extras:
    """What was found in addition to the fit, see `Checks`; `bias` is that by noise, of least squares only.

    `bias_left` is what of it may still be in the estimate, both in SI; `residuals` gives the tests of the
    rows' residuals, which another thread works on meanwhile. `asymmetric` is what directions of motion do to
    friction, of columns that get a number before drift is known.
    """

    periods: PeriodSpread | None = None
    held_out: HeldOut | None = None
    scan: FilterScan | None = None
    bounds: BoundCost | None = None
    bias: FloatArray | None = None
    bias_left: FloatArray | None = None
    changing: ChangingInertia | None = None
    asymmetric: tuple[Asymmetry, ...] = ()
    residuals: Callable[[], tuple[ResidualTest, ...]] = tuple

    @property
    def biases(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the bias by noise and what of it may still be in the estimate, shape (c,) each, if known."""
        return None if self.bias is None or self.bias_left is None else (self.bias, self.bias_left)


def compared(task: Task, solution: Solution, again: Callable[[FilterChoice], Fit]) -> Callable[[], Extras]:
    """Return what gives the comparisons that the records allow, and those that were asked for.

    Another thread works on them from now on, unless records are in files, beside which memory is short, or
    further fits were asked for, of which each tells when it begins.
    """
    work = partial(_compared, task, solution, again)
    files = not all(record.in_memory for record in task.records)
    return work if files or task.unseen or task.checks.scan_cutoffs is not None else meanwhile(work)


def _compared(task: Task, solution: Solution, again: Callable[[FilterChoice], Fit]) -> Extras:
    fit, choice, records, checks = solution.fit, task.choice, task.records, task.checks
    scan, residuals = None, _residuals(task, solution)
    if checks.scan_cutoffs is not None:
        step("scanning filters")
        settings = scanned_settings(choice, records, checks.scan_cutoffs)
        left = {*solution.refused, *solution.at_bounds}
        scan = scan_filters(fit, choice, settings, again, [name for name in fit.columns if name not in left])
    periods = None
    if task.period_s():
        periods = period_spread(fit, records, choice.decimation, task.period_s())
    bias = bias_left = _bias(task, solution.as_measured) if checks.drift_check else None
    if solution.bias is not None:
        bias, bias_left = solution.bias, solution.bias_left
    held, changing = on_unseen(task, solution), _changing(task, solution)
    asymmetric = _asymmetric(task, solution)
    return Extras(periods, held, scan, solution.cost, bias, bias_left, changing, asymmetric, residuals)


def refused_late(
    task: Task, solution: Solution, fit: Fit, drift: FloatArray, extras: Extras
) -> dict[str, str]:
    """Return what is refused with bias and drift, a mean square in SI, shape (c, c), known.

    Where that is all of an arm, swapped channels come first.
    """
    keep = task.checks.keep
    try:
        return late_refusals(fit, solution.refused, drift, keep, extras.biases, task.model)
    except IdentifiabilityError as error:
        raise or_swapped(error, solution.job, fit) from None


def _residuals(task: Task, solution: Solution) -> Callable[[], tuple[ResidualTest, ...]]:
    """Return what gives the tests of the rows' residuals; nothing where they are not asked for."""
    if not task.checks.tests or not task.method.matched:
        return tuple
    # beside records in files memory is short
    files = not all(record.in_memory for record in task.records)
    fit, freed = solution.as_measured, solution.bias is not None
    given = task.model, task.records, task.choice, fit
    return meanwhile(lambda: residual_tests(*given, task.period_s(), freed), here=files)


def _asymmetric(task: Task, solution: Solution) -> tuple[Asymmetry, ...]:
    """Return what directions of motion do to friction."""
    if not task.checks.tests or not task.method.matched:
        return ()
    job, refused = task.job, solution.refused
    return asymmetries(solution.plain, job.model, job.records, job.choice, job.drop, refused)


def _changing(task: Task, solution: Solution) -> ChangingInertia | None:
    """Return an inertia that is a mean only, if nothing else is named that the model lacks."""
    asked = task.checks.drift_check and task.method.matched
    if not asked or any(one.kind == "more than the model" for one in solution.advice):
        return None
    return changing_inertia(solution.fit, solution.job.model, task.records, task.choice)


def _bias(task: Task, fit: Fit) -> FloatArray | None:
    """Return the bias that noise gives the estimate where the method is least squares, else None."""
    job = task.job
    if not isinstance(task.method, WLS):
        return None
    return noise_bias(job.model, job.records, job.choice, fit)


def more_than_noise(fit: Fit, extras: Extras) -> FloatArray:
    """Return what `extras` say that the estimate is off by, as a mean square in SI, shape (c, c)."""
    total = np.zeros((len(fit.columns), len(fit.columns)))
    if extras.periods is not None:
        total += spread_beyond_noise(extras.periods, hac_covariance(fit))
    if extras.held_out is not None:
        total += extras.held_out.drift(fit.columns)
    if extras.bias_left is not None:
        bias = significant_bias(fit, extras.bias_left, hac_covariance(fit))
        total += np.outer(bias, bias)
    if extras.changing is not None:
        total += np.outer(extras.changing.move, extras.changing.move)
    return total


def checked(
    estimate: Estimate,
    task: Task,
    solution: Solution,
    drift: FloatArray,
    refused: Mapping[str, str],
    extras: Extras,
) -> Checks:
    """Return what is checked of an estimate, and why that is not all; `drift`, in SI, has shape (c, c)."""
    kept = tuple(task.checks.keep)
    if not task.checks.tests:
        told = (*solution.advice, untested("is not checked, as asked for"))
        return Checks(told, held_out=extras.held_out, scan=extras.scan, bounds=extras.bounds, kept=kept)
    try:
        return examine(estimate, task, solution, drift, refused, extras)
    except (ArithmeticError, IdentifiabilityError, np.linalg.LinAlgError) as error:
        # the estimate stands; what could not be tested is said, and no more trusted than that
        why = f"could not be checked ({shortened(str(error) or type(error).__name__)})"
        return Checks((*solution.advice, untested(why)), kept=kept)


def untested(what: str) -> Advice:
    """Return what is said of an estimate without checks."""
    return Advice("not checked", "the estimate", what, "compare with another method, or with other records")


def examine(
    estimate: Estimate,
    task: Task,
    solution: Solution,
    drift: FloatArray,
    refused: Mapping[str, str],
    extras: Extras,
) -> Checks:
    """Return all checks of an estimate and of the fit behind it; `drift`, in SI, has shape (c, c)."""
    model, records, choice = task.model, task.records, task.choice
    method, fit, percent = task.method, solution.as_measured, estimate.fit.pruning.percent
    identified, hidden = estimate.parameters.identified, _hidden(model, estimate)
    asked = [entry for entry in identified if entry.name not in hidden]
    names = {entry.name for entry in identified}
    every = (*identified, *(one for one in estimate.parameters.physical if one.name not in names))
    noise = hac_covariance(fit)
    signals = signal_to_noise(model, records, choice)
    residuals = extras.residuals()
    slowest_hz = slowest_mode_hz(model, estimate.physical)
    one_way = one_way_friction(model, fit)
    bounds, periods, left = extras.bounds, extras.periods, extras.bias_left
    told = (
        *solution.advice,
        *swapped_channels(solution.job, fit),
        *unlike_nominal(model, estimate.physical, estimate.records),
        *resting_records(model, records),
        *one_way_advice(model, one_way, refused),
        *short_records(records, choice, fit, slowest_hz),
        *(() if method.matched else band_above_filter(records, choice)),
        *null_solution(fit, model, records, choice, left),
        *negative_values(model, every),
        *dependence_advice(
            dependences(fit, noise + drift),
            asked,
            percent,
            {*dependent_columns(fit, (), drift)} - hidden,
        ),
        *uncertain_parameters(model, fit, identified, percent, slowest_hz, choice.dynamics_hz),
        *(() if method.consistent else noisy_derivatives(model, signals)),
        *(bias_advice(model, fit, left, noise, identified) if left is not None else ()),
        *(bound_advice(bounds) if bounds else ()),
        *(period_advice(periods, noise, fit.columns) if periods else ()),
        *(hold_out_advice(extras.held_out) if extras.held_out else ()),
        *changing_inertia_advice(extras.changing),
        *residual_advice(_alarming(task, solution, residuals)),
    )
    return Checks(
        told,
        residuals,
        signals,
        _periods(periods, fit, estimate),
        extras.held_out,
        extras.scan,
        bounds,
        tuple(task.checks.keep),
    )


def _hidden(model: Model, estimate: Estimate) -> frozenset[str]:
    """Return the composites in place of which physical parameters are told, all of them.

    That composites move together is no matter then: what a user asked for has intervals of its own.
    """
    told = {entry.name for entry in estimate.parameters.physical}
    return frozenset(model.composites) if told and told >= {*model.identifiable} else frozenset()


def _alarming(
    task: Task, solution: Solution, residuals: tuple[ResidualTest, ...]
) -> tuple[ResidualTest, ...]:
    """Return the tests of rows that may raise an alarm.

    Where instruments found nothing that the model lacks, a residual as large as the noise of the sensors is
    that noise, whatever its colour.
    """
    if not task.method.consistent:
        return residuals
    fit = solution.as_measured
    loud = exceeding_noise(task.model, task.records, task.choice, fit, CALM)
    names = {(block.record_name, block.row_name) for block, _ in loud}
    return tuple(one for one in residuals if (one.record, one.row) in names or one.repeats)


def _periods(found: PeriodSpread | None, fit: Fit, estimate: Estimate) -> Periods | None:
    if found is None:
        return None
    place = [fit.columns.index(entry.name) for entry in estimate.parameters.identified]
    covariance = found.covariance[np.ix_(place, place)].tolist()
    return Periods(found.count, tuple(found.period_s.items()), tuple(tuple(row) for row in covariance))
