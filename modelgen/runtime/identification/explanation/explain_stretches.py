"""What becomes of the default is decided on stretches of long records, and estimated on all of their samples.

Which method, what the model lacks, and what that may move: effects that all of a record has,
its stretches have as well: 65,000 samples show them as a million do.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.cutoffs.thinner_records import beyond_means, thinner
from modelgen.runtime.identification.explanation.explain_residual import (
    found_by,
    timing_is_open,
    timing_moves,
    with_timing,
)
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    Explained,
    begun_at,
    begun_with,
    run_method,
    slope_of,
    with_carried_effects,
)
from modelgen.runtime.identification.explanation.look_at_residual import look
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, WLS, Method
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import SEARCHED, STRETCHES
from modelgen.runtime.iv.effect import RIPPLE, Effect
from modelgen.runtime.iv.low_pass import without_starts
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.iv.shapes.shaped_effects import fit_in_shape
from modelgen.runtime.iv.told_effects import held_instead
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record


def long(job: Job) -> bool:
    """Tell whether a record of a job is so long that stretches of it decide."""
    return any(record.n > SEARCHED for record in job.records)


def decided_by_stretches(
    task: Task, chosen: Task, decide: Callable[[Task], Begun], checked: Callable[[Begun], Begun]
) -> Begun:
    """Return what a task becomes by what stretches of its long records say.

    The method that the stretches take is run on all samples, from their estimate on, with the effects that
    they have. What else may move the estimate is known from them.

    Parameters
    ----------
    task, chosen : Task
        As it is given, and with the cut-off that serves all of it.
    decide : callable
        Takes a task to its method, run, and what the residual says.
    checked : callable
        Takes that of all samples to what these say of it.

    Raises
    ------
    DataError
    IdentifiabilityError
        When neither stretches nor the whole records give an estimate.

    Notes
    -----
    Where stretches of a part of the time find nothing, or leave more than noise adds, whole records decide.
    """
    stretches, record_of = _task_of_stretches(chosen)
    try:
        begun = decide(stretches)
    except (IdentifiabilityError, DataError):
        if stretches.job.share == 1.0:
            raise
        return decide(task)
    if (wider := beyond_means(chosen, begun.task)) is not None:
        return decided_by_stretches(task, wider, decide, checked)
    whole, told = _on_all(chosen, begun, record_of), begun.found
    plain = _from_near(begun_at(whole, begun).job, told.fit, whole.method)
    if told.fit.columns != plain.fit.columns:  # stretches answer less than all of a record
        return decide(task)
    found = _with_effects(whole, plain, told, record_of)
    fit = replace(found.fit, notes=(told.fit.notes[0], *found.fit.notes))
    begun = begun_with(whole, replace(found, fit=fit))
    return checked(begun) if stretches.job.share < 1.0 else begun


def explained_by_stretches(task: Task, method: IV, explain: Callable[[Task], Begun]) -> Begun:
    """Return instruments run on all samples, with what stretches of long records show.

    Parameters
    ----------
    task : Task
    method : IV
    explain : callable
        Takes a task to instruments, and what the residual says.

    Raises
    ------
    DataError
    IdentifiabilityError
        When the whole records give no estimate.
    """
    stretches, record_of = _task_of_stretches(task)
    try:
        begun = explain(stretches)
    except (IdentifiabilityError, DataError):
        return run_method(task, method)
    task, told = replace(task, method=method), begun.found
    plain = _from_near(begun_at(task, begun).job, told.fit, method)
    if told.fit.columns != plain.fit.columns:
        return Begun(task, plain)
    return begun_with(task, _with_effects(task, plain, told, record_of))


def _with_effects(task: Task, plain: Explained, told: Explained, record_of: list[int]) -> Explained:
    """Return the fit of whole records with the effects of their stretches, and what else may move it."""
    if not isinstance(task.method, IV):
        return replace(plain, drift=told.drift, unsolved=told.unsolved, advice=told.advice)
    if not told.effects:
        better = _known_better(task.job, plain, told.held)
        drift, unsolved = told.drift + better, told.unsolved + better
        return replace(plain, drift=drift, unsolved=unsolved, advice=told.advice)
    if len(record_of) > len(task.records) and any(effect.kind == RIPPLE for effect in told.effects):
        # stretches have phases of their own, and do not tell the period well enough for whole records
        return _held(plain, told)
    effects, job = _of_records(told.effects, record_of, len(task.records)), task.job
    try:
        if plain.fit.carried is not None:
            begin = plain.fit.physical(job.model.parameters)
            job = replace(job, effects=effects, sizes=told.sizes, begin=begin)
            found = with_carried_effects(job, _from_near(job, plain.fit, task.method))
        else:
            effects, freed = fit_in_shape(job.setting(), job.calm, plain.fit, effects, (), job.sharpened)
            found = Explained(freed.observation, freed.fit, effects, freed.sizes, told.drift, ())
    except (IdentifiabilityError, DataError):
        return _held(plain, told)
    return replace(found, drift=told.drift, unsolved=told.unsolved, advice=told.advice)


def _held(plain: Explained, told: Explained) -> Explained:
    """Return the fit of whole records with what the effects of their stretches move in its intervals."""
    move = told.fit.solution.x - plain.fit.solution.x
    more, advice = np.outer(move, move), held_instead(told.advice, {})
    return replace(plain, drift=told.drift + more, unsolved=told.unsolved + more, advice=advice)


def _known_better(job: Job, plain: Explained, held: Score | None) -> FloatArray:
    """Return what is added to a drift that holds an effect which stretches find likely, (c, c) in SI.

    All samples know its size better. Of some thirty effects of a right model one is likely by chance now
    and then, and moves as much as the noise of the stretches.
    """
    none = np.zeros_like(plain.drift)
    if held is None:
        return none
    now, slope = found_by(job, plain.observation, plain.fit), slope_of(job.model, plain.fit)
    seen = look(job, now, (), slope, (held.effect.kind,))
    alike = [one for one in seen.found if one.effect.name == held.effect.name]
    added = [np.outer(one.move, one.move) for one in alike if one.likely]
    return sum(added, none) - np.outer(held.move, held.move) if alike else none


def timing_by_stretches(job: Job, method: WLS, found: Explained) -> FloatArray:
    """Return what timings move that least squares does not estimate, (c, c); of long records, in stretches.

    In SI, as `timing_moves`; `job` says how rows are taken, and which delays were to be found.
    """
    if long(job):
        parts, _ = in_stretches(job)
        try:
            observation, fit = method.run(replace(parts, late=()))
        except (IdentifiabilityError, DataError):
            return timing_moves(job, found.observation, found.fit)
        if fit.columns == found.fit.columns:
            return timing_moves(parts, observation, fit)
    return timing_moves(job, found.observation, found.fit)


def with_timing_by_stretches(job: Job, method: IV, found: Explained) -> Explained:
    """Return `with_timing` of instruments; of long records in stretches, as far as it widens and tells."""
    if not long(job):
        return with_timing(job, found)
    parts, _ = in_stretches(job)
    if not timing_is_open(parts, found):
        return found
    none = np.zeros_like(found.drift)
    try:
        observation, fit = method.run(parts)
    except (IdentifiabilityError, DataError):
        return with_timing(job, found)
    if fit.columns != found.fit.columns:
        return with_timing(job, found)
    told = with_timing(parts, Explained(observation, fit, (), (), none, ()))
    return replace(found, drift=found.drift + told.drift, advice=(*found.advice, *told.advice))


def _task_of_stretches(task: Task) -> tuple[Task, list[int]]:
    """Return the task of stretches of long records, and the record that each is of."""
    whole = thinner(task.job) or task.job
    job, record_of = in_stretches(whole)
    every, taken = (sum(record.duration_s for record in one.records) for one in (whole, job))
    job = replace(job, share=taken / every)
    return replace(task, records=job.records, choice=job.choice, job=job), record_of


def in_stretches(job: Job) -> tuple[Job, list[int]]:
    """Return the job of stretches of long records, or of means, and the record that each is of."""
    job = thinner(job) or job
    stretches = [_stretches(record) for record in job.records]
    factors = tuple(factor for factor, one in zip(job.choice.decimation, stretches, strict=True) for _ in one)
    records = tuple(part for one in stretches for part in one)
    parts = replace(job, records=records, choice=replace(job.choice, decimation=factors), surveys=())
    return parts, [index for index, one in enumerate(stretches) for _ in one]


def _on_all(task: Task, begun: Begun, record_of: list[int]) -> Task:
    """Return a task with the settings that stretches decided, and what they did to the records."""
    decided, job = begun.task, begun.task.job
    rates = zip(job.choice.decimation, job.records, strict=True)
    steps_s = dict(zip(record_of, (factor / part.fs for factor, part in rates), strict=True))
    factors = tuple(round(steps_s[index] * record.fs) for index, record in enumerate(task.records))
    choice = replace(job.choice, decimation=factors)
    task = task.changed(*decided.changes)
    records = task.records
    for change in job.changes[len(decided.changes) :]:
        records = change(records)
    whole = replace(
        job, records=records, choice=choice, surveys=task.job.surveys, effects=(), sizes=(), share=1.0
    )
    return replace(task, method=decided.method, choice=choice, job=whole)


def _from_near(job: Job, fit: Fit, method: Method) -> Explained:
    """Return a method run on whole records, instruments from the fit of their stretches on."""
    found = None
    if isinstance(method, IV):
        # the stretches' own simulations are of no use to whole records; physical steps know where to begin
        near = job if fit.carried is not None else replace(job, start=replace(fit, simulated=None))
        with suppress(IdentifiabilityError, DataError):
            found = method.run(near)
    observation, whole = found or method.run(replace(job, known_delays=None))
    return Explained(observation, whole, (), (), np.zeros((len(whole.columns),) * 2), ())


def _of_records(effects: tuple[Effect, ...], record_of: list[int], records: int) -> tuple[Effect, ...]:
    """Return effects of stretches as those of the records: a zero that a stretch has is its record's."""
    found: dict[str, Effect] = {}
    for effect in effects:
        if effect.record is not None:
            effect = zero_effect(effect.channel, record_of[effect.record], records)
        found[effect.name] = without_starts(effect)
    return tuple(found.values())


def _stretches(record: Record) -> tuple[Record, ...]:
    """Return a short record, or stretches spread over a long one, or over where a very long one is active."""
    if record.n <= SEARCHED:
        return (record,)
    parts = record.facts.parts
    if parts == (slice(0, record.n),):
        edges = [k * (record.n // STRETCHES) for k in range(STRETCHES + 1)]
        parts = tuple(slice(start, stop) for start, stop in pairwise(edges))
    length = SEARCHED // len(parts)
    starts = [part.start + (part.stop - part.start - length) // 2 for part in parts]
    return tuple(record.part(start, start + length, f"{record.name} from sample {start}") for start in starts)
