"""What stretches of long records say of the model: effects that all of a record has, they have as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.explanation.explain_residual import explained, found_by, timing_moves
from modelgen.runtime.identification.explanation.explained import Begun, Explained, run_method
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, WLS
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import SEARCHED, STRETCHES
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.iv.shaped_effects import fit_in_shape
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record


def explained_by_stretches(task: Task, method: IV) -> Begun:
    """Return a task with instruments run, and what stretches of long records show, on the whole of them.

    Effects are looked for in stretches, and estimated on all samples if there are any. What stretches give is
    also what the fit of all samples starts from.

    Raises
    ------
    DataError
    IdentifiabilityError
        When the whole records give no estimate.
    """
    job = task.job
    found = _of_stretches(job, method)
    if found is None:
        return run_method(task, method)
    fit, told, record_of = found
    begun = _started_near(task, method, fit)
    plain = begun.found
    if told.fit.columns != plain.fit.columns:
        return begun
    if not told.effects:
        return replace(begun, found=replace(plain, drift=told.drift, advice=told.advice))
    effects = _of_records(told.effects, record_of, len(job.records))
    try:
        effects, freed = fit_in_shape(job.setting(), job.calm, plain.fit, effects, (), job.sharpened)
    except (IdentifiabilityError, DataError):
        move = told.fit.solution.x - plain.fit.solution.x
        moved = told.drift + np.outer(move, move)
        return replace(begun, found=replace(plain, drift=moved, advice=told.advice))
    return replace(
        begun, found=Explained(freed.observation, freed.fit, effects, freed.sizes, told.drift, told.advice)
    )


def _of_stretches(job: Job, method: IV) -> tuple[Fit, Explained, list[int]] | None:
    """Return the fit of stretches, what they show and the record that each is of; None where nothing fits."""
    parts, record_of = _in_stretches(job)
    try:
        observation, fit = method.run(parts)
    except (IdentifiabilityError, DataError):
        return None
    return fit, explained(parts, found_by(parts, observation, fit), fit), record_of


def timing_by_stretches(job: Job, method: WLS, found: Explained) -> FloatArray:
    """Return what timings move that least squares does not estimate, (c, c); of long records, in stretches.

    As `timing_moves`; `job` says how rows are taken, and which delays were to be found.
    """
    if any(record.n > SEARCHED for record in job.records):
        parts, _ = _in_stretches(job)
        try:
            observation, fit = method.run(replace(parts, late=()))
        except (IdentifiabilityError, DataError):
            return timing_moves(job, found.observation, found.fit)
        if fit.columns == found.fit.columns:
            return timing_moves(parts, observation, fit)
    return timing_moves(job, found.observation, found.fit)


def _in_stretches(job: Job) -> tuple[Job, list[int]]:
    """Return the job of stretches of long records, and the record that each is of."""
    stretches = [_stretches(record) for record in job.records]
    factors = tuple(factor for factor, one in zip(job.choice.decimation, stretches, strict=True) for _ in one)
    records, choice = (
        tuple(part for one in stretches for part in one),
        replace(job.choice, decimation=factors),
    )
    parts = replace(job, records=records, choice=choice, surveys=())
    return parts, [index for index, one in enumerate(stretches) for _ in one]


def _started_near(task: Task, method: IV, fit: Fit) -> Begun:
    """Return a task with instruments run on whole records, from the fit of their stretches on."""
    if fit.carried is not None:  # physical parameters have starts of their own
        return run_method(task, method)
    # the stretches' own simulations are of no use to whole records
    job = replace(task.job, start=replace(fit, simulated=None))
    try:
        begun = run_method(replace(task, job=job), method)
    except (IdentifiabilityError, DataError):
        return run_method(task, method)
    return replace(begun, task=replace(begun.task, job=task.job))


def _of_records(effects: tuple[Effect, ...], record_of: list[int], records: int) -> tuple[Effect, ...]:
    """Return effects of stretches as those of the records: a zero that a stretch has is its record's."""
    found: dict[str, Effect] = {}
    for effect in effects:
        if effect.record is not None:
            effect = zero_effect(effect.channel, record_of[effect.record], records)
        found[effect.name] = effect
    return tuple(found.values())


def _stretches(record: Record) -> tuple[Record, ...]:
    """Return a short record, or stretches spread over a long one."""
    if record.n <= SEARCHED:
        return (record,)
    length, gap = SEARCHED // STRETCHES, record.n // STRETCHES
    starts = [k * gap + (gap - length) // 2 for k in range(STRETCHES)]
    return tuple(record.part(start, start + length, f"{record.name} from sample {start}") for start in starts)
