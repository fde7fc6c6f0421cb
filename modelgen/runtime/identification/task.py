"""Task: records made ready for the fit: checked, filters chosen, known delays compensated."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, SMALLEST
from modelgen.progress import step
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.hold_out import held_apart, little_left
from modelgen.runtime.diagnostics.periods import periods_of
from modelgen.runtime.diagnostics.samples.leaps import without_leaps
from modelgen.runtime.diagnostics.samples.suspicious_samples import misread, suspicions, told_on_failure
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.identification.job import Change, Job
from modelgen.runtime.identification.methods import IV, WLS, Auto, Method, Pham2002
from modelgen.runtime.identification.options import CheckOptions, Filters, option_problems
from modelgen.runtime.identification.thresholds import MEGABYTE
from modelgen.runtime.least_squares.known_delays import aligned
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.model.power.power_model import power_model
from modelgen.runtime.numerics.threads import meanwhile
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.records.channel_checks import other_units
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.directions import (
    Source,
    direction_problems,
    direction_sentences,
    direction_sources,
    wanted_directions,
    with_directions,
)
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.same_data import Contents, refuse_same_data
from modelgen.runtime.rows.derived_channels import as_records, with_derived
from modelgen.runtime.rows.masks import slow_speeds
from modelgen.runtime.rows.paper_rows import paper_sentence
from modelgen.runtime.rows.rows_by_tag import rows_for_tags


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be identified from what.

    Attributes
    ----------
    model : Model
    method : Method
    checks : CheckOptions
    records, unseen : tuple of Record
        To identify from, and held out; known delays and holds compensated.
    period_s : callable
        Gives the period in s of periodic records, by name.
    doubts : callable
        Gives what looks wrong in the samples.
    choice : FilterChoice
    job : Job
        The same for the method.
    filters : Filters
        What was given of them.
    contents : sequence of str
        Of the records to identify from, as they were given (`modelgen.runtime.records.same_data.contents`).
    changes : tuple of callable
        What was done to the records since, those of the job and those held out alike.
    """

    model: Model
    method: Method
    checks: CheckOptions
    records: tuple[Record, ...]
    unseen: tuple[Record, ...]
    period_s: Callable[[], Mapping[str, float]]
    doubts: Callable[[], tuple[Advice, ...]]
    choice: FilterChoice
    job: Job
    filters: Filters
    contents: Sequence[str]
    changes: tuple[Change, ...] = ()

    @property
    def sets_channels_right(self) -> bool:
        """Whether channels of an elastic arm are looked at, and set right, before the fit."""
        return self.checks.drift_check and isinstance(self.method, Auto) and self.method.rows != "power"

    def changed(self, *changes: Change) -> Task:
        """Return the task with other records in the place of its own."""
        task = self
        for change in changes:
            job = task.job.changed(change)
            # what is the same stays the same: spectra and what noise does are then looked for once
            alike = [*map(id, task.records)] == [*map(id, task.job.records)]
            task = replace(
                task,
                records=job.records if alike else change(task.records),
                unseen=change(task.unseen),
                job=job,
                changes=(*task.changes, change),
            )
        return task


def prepared(
    model: Model | ModuleType,
    records: Record | Channels | Sequence[Record | Channels],
    method: Method,
    filters: Filters,
    checks: CheckOptions,
) -> Task:
    """Return the task that records and options make.

    Raises
    ------
    DataError
        When an option is out of range, a channel is missing, or a record is too short.
    """
    model = model if isinstance(model, Model) else model_from_module(model)
    if method.rows == "power":
        model = power_model(model)
    every = with_derived(model, as_records(records))
    problems = [*option_problems(method, filters, checks), *_method_problems(model, method)]
    guess = isinstance(method, (IV, Auto)) and all_from_composites(model)
    nearest, sources = direction_sources(model, every, filters.directions, guess, method.matched)
    filters = replace(filters, directions={**filters.directions, **nearest})
    _check(model, every, problems, sources, method.held)
    # what reads files at the same time takes memory of its own
    files = not all(one.in_memory for one in every)
    at_once = checks.hold_out is not None or bool(checks.period_s)
    period_s = _periods(model, every, checks, files or at_once)
    kept, unseen = held_apart(every, checks.hold_out, period_s() if at_once else {})
    told = _contents(model, every, {record.name for record in kept}, files)
    step("choosing filters")
    doubts = meanwhile(partial(suspicions, model, kept), files) if checks.tests else tuple[Advice, ...]
    if checks.tests:
        kept, unseen = without_leaps(model, kept), without_leaps(model, unseen)
    with told_on_failure(doubts), little_left(checks.hold_out):
        choice = _chosen(model, kept, filters, method)
    slow = slow_speeds(model, filters.slow_speeds)
    said = choice.sentences + direction_sentences(model, sources, choice.direction_cutoff_hz)
    filtered, named = filters.filtered_forces, tuple(sources.items())
    choice = replace(choice, slow_speeds=slow, filtered_forces=filtered, sentences=said, directions=named)

    def ready(given: tuple[Record, ...]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
        extended = with_directions(model, given, sources, choice.direction_cutoff_hz)
        return aligned(model, extended, method.delays, method.held, method.consistent)

    (kept, late), limit_mb = ready(kept), filters.memory_limit_mb
    job = Job(
        model,
        kept,
        choice,
        filters.drop or 0,
        rows_for_tags(model, method.rows_for_tag),
        method.loop if isinstance(method, (IV, Auto)) else None,
        late,
        robust=method.robust,
        bounds=method.bounds,
        memory_limit=None if limit_mb is None else MEGABYTE * limit_mb,
        begin=_begin(model, method),
        guessed=tuple(nearest),
    )
    return Task(model, method, checks, kept, ready(unseen)[0], period_s, doubts, choice, job, filters, told)


def _chosen(model: Model, records: Sequence[Record], filters: Filters, method: Method) -> FilterChoice:
    """Return the filters: those that are given, the others chosen from the records."""
    return choose_filter(
        model,
        records,
        cutoff_hz=filters.cutoff_hz,
        filter_order=filters.filter_order,
        decimation=filters.decimation,
        direction_cutoff_hz=filters.direction_cutoff_hz,
        signal_cutoff_hz=filters.signal_cutoff_hz,
        paper=None if method.matched else paper_sentence(filters.filtered_forces),
    )


def _contents(model: Model, records: Sequence[Record], used: Collection[str], files: bool) -> Sequence[str]:
    """Return the contents of the records of these names; of files at once, as these may change."""
    found = Contents([one for one in records if one.name in used], model.channels)
    return tuple(found) if files else found


def _periods(
    model: Model, records: Sequence[Record], checks: CheckOptions, here: bool
) -> Callable[[], Mapping[str, float]]:
    """Return what gives the periods of records, found by another thread unless `here`."""
    if not checks.tests and not checks.period_s:
        return dict[str, float]
    return meanwhile(partial(periods_of, model, records, checks.period_s), here)


def _method_problems(model: Model, method: Method) -> list[Problem]:
    """Return what is wrong with a method for a model: some need a chain, loops are of one or the other."""
    if method.rows == "power" and not isinstance(method, (Auto, WLS)):
        return [Problem("rows", f"are power, and the method is {method.name}", "use wls, or leave one out")]
    loop = method.loop if isinstance(method, (IV, Auto)) else None
    if loop is not None:
        from modelgen.runtime.simulation.arms.joint_controller import JointController

        if isinstance(loop.controller, JointController) != model.is_arm:
            wanted = "JointController" if model.is_arm else "PositionVelocityController"
            kind = "a chain" if model.is_arm else "an arm"
            return [Problem("loop", f"has the controller of {kind}", f"give Loop({wanted}(...))")]
    if not model.is_arm or isinstance(method, (Auto, WLS, Pham2002)):
        return []
    if not isinstance(method, IV):
        return [Problem("method", f"is {method.name}, which takes chains", "use iv or wls, or leave it out")]
    # least squares needs no simulation
    from modelgen.runtime.simulation.arms.arm_coordinates import follows

    if not follows(model):
        return [Problem("method", "is iv, which takes arms with rigid joints", "use wls, or leave it out")]
    if method.start is not None:
        return [Problem("start", "is given for an arm, whose instruments need none", "leave it out")]
    return []


def _begin(model: Model, method: Method) -> Mapping[str, float] | None:
    if not isinstance(method, IV) or method.start is None:
        return None
    # least squares needs no instruments, and what they load
    from modelgen.runtime.identification.starting_set import starting_set

    return starting_set(model, method.start)


def _check(
    model: Model,
    records: Sequence[Record],
    problems: list[Problem],
    directions: Mapping[str, Source],
    held: Sequence[str],
) -> None:
    """Raise one DataError for what is wrong with the options and with the records' channels."""
    problems += direction_problems(model, records, directions)
    measured = [key for key in model.channels if key not in wanted_directions(model)]
    for record in records:
        problems += other_units(record.name, record.units, model.channel_units)
        missing = [key for key in measured if key not in record.signals]
        problems += [missing_name(record.name, "channel", key, record.signals) for key in missing]
        # products of such samples would be lost: no answer, or one of rounding
        peaks = {k: record.facts.extent(k).peak for k in model.channels if k in record.signals}
        problems += [
            Problem(f"{record.name}: channel {key}", f"is {peak:g}: none reaches {SMALLEST:g}", REMEDY)
            for key, peak in peaks.items()
            if 0.0 < peak < SMALLEST
        ]
        problems += misread(model, record, held)
    problems += _unmoved(model, records)
    if problems:
        raise DataError(*problems)
    refuse_same_data(records, measured)


def _unmoved(model: Model, records: Sequence[Record]) -> list[Problem]:
    """Return one problem per sensor of a chain's body that reads one number in all records, beside others.

    A body that is held there feels a force that is in no row.
    """
    if model.is_arm:
        return []
    sensors = {sensor.key: sensor.body for sensor in model.sensors if sensor.body}
    spans = {
        key: max(record.facts.extent(key).span for record in records)
        for key in sensors
        if all(key in record.signals for record in records)
    }
    if not any(spans.values()):
        return []
    return [
        Problem(
            f"{record.name}: channel {key}",
            f"reads {record.facts.extent(key).least + 0.0:.6g} in every sample: it does not say how "
            f"{sensors[key]} moves",
            f"check its cable; where {sensors[key]} is clamped, take it out of the spec, its link to ground",
        )
        for key, span in spans.items()
        if span == 0.0
        for record in records[:1]
    ]
