"""Solution: the fit of an task, what its records cannot answer, and the same at other settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from numbers import Real

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.advice import Advice, noted
from modelgen.runtime.diagnostics.cutoff_agreement import (
    all_disagreements,
    coordinates_of,
    disagreement_notes,
    significant_drift,
)
from modelgen.runtime.diagnostics.hold_out import HeldOut, held_out, little_left
from modelgen.runtime.diagnostics.motion_checks import clipped_forces
from modelgen.runtime.diagnostics.noise_bias import less_noise, takes_instruments
from modelgen.runtime.diagnostics.samples.suspicious_samples import told_on_failure
from modelgen.runtime.diagnostics.settings_drift import (
    Attempts,
    SolvedColumns,
    cutoff_drift,
    direction_drift,
    load_row_drift,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.record_length import decimation_for
from modelgen.runtime.identification.contradiction import with_impossible_signs
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.memory_limit import beyond_limit
from modelgen.runtime.identification.methods import IV, WLS, Auto
from modelgen.runtime.identification.refusals import all_refused, refusals
from modelgen.runtime.identification.robust_and_bounded import Treatment, treat, unweighted
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import FIRST_ORDER, LEFT_BIAS
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import solve_matched
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.parameters.bounds import BoundCost, bound_reasons
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import brings_directions
from modelgen.runtime.rows.left_open.uncertain_turns import leaves_turns_open
from modelgen.runtime.rows.masks import Survey
from modelgen.runtime.rows.observation import Observation, observe
from modelgen.runtime.rows.paper_rows import observe_paper
from modelgen.runtime.rows.row_triangles import observe_triangles


@dataclass(frozen=True, eq=False)
class Solution:
    """What a method made of an task.

    Attributes
    ----------
    observation : Observation
        The rows.
    plain, fit, as_measured : Fit
        The method's own fit; with robust weights and within bounds, where these were asked for; and the
        latter's parameters on the rows as they were.
    refused, at_bounds : mapping of str to str
        Columns that get no number, and those that lie at a bound, with the reason.
    advice : tuple of Advice
    treatment : Treatment
        What makes `fit` of `plain`; the same is done at other settings.
    cost : BoundCost or None
        What bounds cost.
    job : Job
        What was done, for doing it again.
    drift : array, shape (c, c)
        Mean square of what effects would move that the residual shows and that were not estimated.
    bias, bias_left : array, shape (c,), optional
        What noise of the sensors gives least squares, where it was taken off the fits, and how much of it may
        be left: the share of noise in the columns is that of the second order in the first.
    driven : bool
        Whether what noise of the forces does to instruments is taken off fits where it matters.
    """

    observation: Observation
    plain: Fit
    fit: Fit
    as_measured: Fit
    refused: Mapping[str, str]
    at_bounds: Mapping[str, str]
    advice: tuple[Advice, ...]
    treatment: Treatment
    cost: BoundCost | None
    job: Job
    drift: FloatArray
    bias: FloatArray | None = None
    bias_left: FloatArray | None = None
    driven: bool = False

    @property
    def delays(self) -> dict[str, float]:
        """Delays in s that were estimated, by channel."""
        return {channel: delay for channel, delay, _ in self.fit.delays}

    @cached_property
    def moved(self) -> tuple[Record, ...]:
        """The records of `job` with these delays compensated."""
        return tuple(advanced(record, self.delays) for record in self.job.records)

    def at(self, task: Task, other: FilterChoice) -> Fit:
        """Return the fit with other filters, from this one on; delays stay."""
        surveys = self._surveys(task, other)
        # the records have no delay left that a fit could start from
        start = replace(self.plain, delays=())
        job = replace(self.job, records=self.moved, late=(), choice=other, start=start, surveys=surveys)
        fit = task.method.run(job)[1]
        if self.bias is not None:
            fit, effect = less_noise(job.model, job.records, other, fit)
            if effect.most >= FIRST_ORDER:
                what = f"are {100.0 * effect.most:.0f} % noise along a combination"
                raise IdentifiabilityError.at("columns", what, "use a lower cut-off")
        if self.driven:
            from modelgen.runtime.identification.explanation.less_driven import less_driven

            fit = less_driven(job, task.method, fit, again=True)[0]
        return self.treatment(fit)

    def found_at(self, task: Task, other: FilterChoice) -> SolvedColumns:
        """Return the solution of that fit; of least squares without a second set of rows in memory."""
        job, plain = self.job, isinstance(task.method, WLS) and self.treatment == Treatment()
        if not plain or job.rows_for_tag is not None or self.plain.projected is not None:
            return self.at(task, other)
        # triangles know of no directions that records bring
        if leaves_turns_open(job.model) or any(brings_directions(job.model, one) for one in self.moved):
            surveyed = replace(job, choice=other, surveys=self._surveys(task, other))
            return solve_matched(surveyed.observed(self.moved).blocks, job.model.base_parameters)
        rows = observe_triangles(job.model, self.moved, other, job.drop, self._surveys(task, other))
        return solve_matched(rows, job.model.base_parameters)

    def _surveys(self, task: Task, other: FilterChoice) -> tuple[Survey, ...]:
        # speeds at standstill belong to the filter for directions
        same = other.direction_cutoff_hz == task.choice.direction_cutoff_hz
        return self.observation.surveys if same else ()


def fitted(task: Task) -> tuple[Task, Solution]:
    """Return the task with the method that the default became, its fit, and what the records cannot answer.

    Raises
    ------
    DataError
        When a record is too short for the filter.
    IdentifiabilityError
        When the records answer none of the parameters.
    """
    step("filtering and solving")
    with told_on_failure(task.doubts), little_left(task.checks.hold_out):
        start, by_default = _run(task), isinstance(task.method, Auto)
        task, told = start.task, start.found
        model, job, method, plain = task.model, task.job, task.method, told.fit
        refused, advice = refusals(model, job.records, job.choice, plain, task.checks.keep)
        if all(name in refused for name in plain.columns):
            raise all_refused(refused, model)
    if method.robust is None and (clipped := clipped_forces(model, job.records, job.choice, plain)):
        raise IdentifiabilityError(*clipped)
    if by_default:
        told = with_impossible_signs(model, told, refused)
    said, notes = noted(told.advice)
    plain = replace(plain, notes=plain.notes + notes)
    bias, bias_left, driven, drift = None, None, False, told.drift
    if isinstance(method, IV):  # least squares does not load what simulates
        from modelgen.runtime.identification.explanation.less_driven import less_driven

        plain, left, notes = less_driven(job, method, plain, known=start.driven)
        plain, drift, driven = replace(plain, notes=plain.notes + notes), drift + left, bool(notes)
    if _bias_counts(task, by_default):
        freed, effect = less_noise(model, job.records, job.choice, plain)
        if effect.most < FIRST_ORDER:
            plain, bias, bias_left = freed, effect.bias, max(LEFT_BIAS, effect.most) * effect.bias
    fit, treatment, cost = treat(plain, model, method.robust, method.bounds)
    kept = [plain.columns.index(name) for name in fit.columns]
    return task, Solution(
        told.observation,
        plain,
        fit,
        unweighted(fit, plain),
        refused,
        bound_reasons(cost, fit) if cost else {},
        (*task.doubts(), *said, *advice),
        treatment,
        cost,
        treatment.job(job),
        drift[np.ix_(kept, kept)],
        bias,
        bias_left,
        driven,
    )


def _bias_counts(task: Task, by_default: bool) -> bool:
    """Tell whether least squares are plain, and of an arm of which no simulation makes instruments.

    Who asks for least squares gets them; but of rows that hold positions which springs give. Readings are
    differentiated up to six times there.
    """
    method, model = task.method, task.model
    plain = isinstance(method, WLS) and method.robust is None and method.bounds is None
    asked = isinstance(model.kernel, DeflectedKernel) or by_default
    return plain and asked and model.is_arm and not takes_instruments(model)


def _run(task: Task) -> Begun:
    # least squares needs no simulation, and what it loads
    if isinstance(task.method, Auto):
        from modelgen.runtime.identification.held.without_ends import default_without_ends

        return default_without_ends(task, task.method)
    beyond = beyond_limit(task.job, task.method)
    if beyond is not None:
        raise DataError(beyond)
    if task.model.is_arm and isinstance(task.method, IV):
        from modelgen.runtime.identification.cutoffs.choose_cutoff import with_predicted_cutoff

        return run_method(with_predicted_cutoff(task, consistent=True), task.method)
    begun = run_method(task, task.method)
    if not isinstance(task.method, IV) or not task.checks.drift_check:
        return begun
    from modelgen.runtime.identification.explanation.explain_stretches import with_timing_by_stretches

    return replace(begun, found=with_timing_by_stretches(begun.task.job, task.method, begun.found))


def settings_drift(
    task: Task, solution: Solution, again: Callable[[FilterChoice], Fit]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return how far settings that should not matter move the estimate, as a mean square, and notes on it.

    The mean square, (c, c) in SI, is that of `solution.fit`.

    Parameters
    ----------
    again : callable
        The fit with other filters.
    """
    method, choice, fit = task.method, task.choice, solution.fit
    lowest_fs = min(record.fs for record in task.records)
    directions = bool(task.model.direction_keys)
    if method.consistent or solution.bias is not None:
        tried = Attempts(again, choice, fit.columns)
        seen = coordinates_of(fit, task.model, solution.treatment.at_zero)
        found = all_disagreements(fit, choice, lowest_fs, tried, directions, seen)
        named = [name for name in seen.names if name not in solution.refused]
        notes = disagreement_notes(found, seen.names, named)
        return seen.in_columns(significant_drift(found, len(seen.names))), notes + tried.notes
    found_at = Attempts(partial(solution.found_at, task), choice, fit.columns)
    drift = cutoff_drift(fit, choice, lowest_fs, found_at)
    if directions:
        drift += direction_drift(fit, choice, lowest_fs, found_at)
    if isinstance(method, WLS):
        kept = [solution.plain.columns.index(name) for name in fit.columns]
        drift += load_row_drift(solution.plain, solution.observation)[np.ix_(kept, kept)]
    return drift, found_at.notes


def on_unseen(task: Task, solution: Solution) -> HeldOut | None:
    """Return how a fit does on records it has not seen; None without any. Raises DataError if too short."""
    if not task.unseen:
        return None
    job, method, fit = solution.job, task.method, solution.as_measured
    held = tuple(advanced(record, solution.delays) for record in task.unseen)
    given, cutoff_hz = task.filters.decimation, job.choice.cutoff_hz
    decimation = tuple(given or decimation_for(record.fs, cutoff_hz) for record in held)
    tags = [record.tag for record in held]
    rows = None if job.rows_for_tag is None else {t: r for t, r in job.rows_for_tag.items() if t in tags}
    choice = replace(job.choice, decimation=decimation)
    apart = replace(job, records=held, choice=choice, late=(), rows_for_tag=rows)
    if job.effects:
        from modelgen.runtime.iv.freed_effects import on_other_records

        sized, tails = (
            dict(zip(job.effects, job.all_sizes, strict=True)),
            isinstance(task.checks.hold_out, Real),
        )
        records, effects, sizes = on_other_records(sized, held, tails)
        apart = replace(apart, records=records, effects=effects, sizes=sizes, start=None)
    try:
        observation, own = method.run(apart)
        if job.effects and {*fit.columns} <= {*own.columns}:
            # what was estimated together with the parameters is off the rows there
            observation = Observation(own.columns, own.blocks)
        return held_out(fit, solution.refused, observation, solution.treatment(own))
    except IdentifiabilityError:  # they cannot answer for themselves, but can be looked at
        watch = observe if method.matched else observe_paper
        observation = watch(job.model, apart.records, choice, job.drop)
        return held_out(fit, solution.refused, apart.only_rows_for_tag(observation), None)
