"""Directions of bodies from a simulation at the estimate, for rows that use samples near reversals.

Where every sample feels a reversal, and in least squares that takes the place of instruments, friction is
no sign of a low-passed velocity: that bends where friction jumps and turns late, and a body that sticks needs
less than its friction. A simulation with the estimate, kept close to the record, knows all of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.explanation.explain_residual import explained, found_by, timing_moves
from modelgen.runtime.identification.explanation.explained import Begun, begun_at, run_method, with_note
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import physical_setting, run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import TURNED_GAIN, TURNED_ROUNDS, TURNS_MOVE
from modelgen.runtime.iv.companion_simulation import (
    Loop,
    Simulated,
    followed_closely,
    simulated_beside,
)
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.iv.physical.composite_iv import moved_by_turns
from modelgen.runtime.iv.physical.friction_rows import directions, other_directions
from modelgen.runtime.iv.score_tests import Span
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import negative_columns
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import (
    bodies_with_signs,
    brings_directions,
    direction_channel,
    signs_of_rows,
    with_given_directions,
)
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.simulation.plant import possible

SIMULATED = "directions near reversals are those of a simulation at the estimate"


def with_simulated_directions(begun: Begun) -> Begun:
    """Return instruments whose rows take directions near reversals from a simulation at the estimate.

    As they are where no row uses such samples and none turns unseen, or where that leaves more unexplained or
    less known; the intervals hold then what unseen reversals move.
    """
    task, found, fit = begun.task, begun, begun.found.fit
    signs = signs_of_rows(task.model)
    # rows that drop friction have it from a simulation already, made anew in every step
    near = any(block.turning and signs[block.row] for block in fit.blocks)
    unseen = None if near else _moved_by_unseen(begun)
    for _ in range(TURNED_ROUNDS if near or unseen is not None else 0):
        fit = found.found.fit
        start = replace(task, job=replace(task.job, reversing=task.job.reversing or not near))
        again = _turned_anew(start, found)
        if again is None or left_a_sample(again.found.fit) > left_a_sample(fit):
            found = found if found is begun else _unsettled(found, again)
            break
        found = again
    if unseen is not None and (found is begun or _digits(found) < _digits(begun, unseen)):
        return _moved(begun, unseen)
    if found is not begun:
        return with_uncertain_turns(with_note(found, SIMULATED))
    return begun if fit.carried is None else with_uncertain_turns(begun)


def with_uncertain_turns(begun: Begun) -> Begun:
    """Return an estimate whose intervals hold what `other_directions` move.

    A direction is wrong as often one way as the other, which is no noise to instruments.
    """
    task, fit, rows = begun.task, begun.found.fit, begun.found.observation
    job = task.job
    if not all(block.in_memory for block in rows.blocks):
        return begun
    if fit.carried is not None:
        setting, rules = physical_setting(job)
        return _moved(begun, moved_by_turns(setting, rows, fit, rules))
    late = {channel: delay for channel, delay, _ in fit.delays}
    values = possible(job.model, simulation_parameters(job.model, fit))
    read, closer = list[Record](), list[Record]()
    for record in job.records:
        on_time, close = _followed(record, job.model, values, job.choice, job.loop, late)
        other = other_directions(close, bodies_with_signs(job.model), job.choice, job.loop)
        read.append(on_time)
        closer.append(on_time.edited(other))
    every = job.reversing or (job.turns and not task.method.consistent)
    own, again = (
        with_given_directions(rows, job.model, records, job.choice, job.drop, every)
        for records in (read, closer)
    )
    return _moved(begun, _move(fit, again, own))


def _moved(begun: Begun, move: FloatArray) -> Begun:
    """Return an estimate whose intervals hold a move of X, shape (c,) in SI."""
    return replace(begun, found=replace(begun.found, drift=begun.found.drift + np.outer(move, move)))


def explained_with_directions(begun: Begun, before: Begun | None = None) -> Begun:
    """Return instruments with what their residual shows, and directions that know of it.

    A simulation without a force, or with the friction that was found without it, has bodies turn elsewhere:
    that is left then, and hides what else is missing. Directions are made anew where what was found explains
    some of the residual, more than a fit `before` without effects left, and are kept where that leaves less.
    """
    told, before = _explained(begun), before or begun
    for _ in range(TURNED_ROUNDS):
        fit = told.found.fit
        gain = left_a_sample(before.found.fit) - left_a_sample(fit)
        if gain < TURNED_GAIN or not turned(told):
            break
        again = _turned_anew(begun.task, told)
        again = again and _explained(with_note(again, SIMULATED, begun.found.drift))
        if again is None or left_a_sample(again.found.fit) > left_a_sample(fit):
            told = _unsettled(told, again)
            break
        told, before = again, told
    return told if turned(begun) or not turned(told) else with_uncertain_turns(told)


def turned(begun: Begun) -> bool:
    """Tell whether the records bring directions of bodies, of a simulation say."""
    return any(brings_directions(begun.task.model, one) for one in begun.task.job.records)


def _unsettled(found: Begun, again: Begun | None) -> Begun:
    """Return an estimate with what directions that were simulated once more move, though they leave more.

    Which of the two leaves less hangs on few samples about reversals: the intervals hold either.
    """
    if again is None or again.found.fit.columns != found.found.fit.columns:
        return found
    return _moved(found, again.found.fit.solution.x - found.found.fit.solution.x)


def _explained(begun: Begun) -> Begun:
    """Return what the residual of instruments says, with the drift that there was."""
    job, found = begun.task.job, begun.found
    told = explained(job, found_by(job, found.observation, found.fit), found.fit)
    return replace(begun, found=replace(told, drift=told.drift + found.drift))


def _turned_anew(task: Task, found: Begun) -> Begun | None:
    """Return a task run with directions of a simulation at a fit; None where columns are others, or none.

    A fit with directions of low-passed velocities may have most of its friction from these, and steps from
    it lead nowhere. Least squares needs no start.
    """
    fit = found.found.fit
    with suppress(IdentifiabilityError, DataError):
        job = directed(task.job, fit)
        with suppress(IdentifiabilityError):
            return _begun_at_fit(task, job, found, fit)
        rough = replace(run_wls(replace(job, late=()))[1], delays=fit.delays)
        return _begun_at_fit(task, directed(task.job, rough), found, rough)
    return None


def _begun_at_fit(task: Task, job: Job, found: Begun, fit: Fit) -> Begun | None:
    """Return a task run with a job, begun at a fit; None where columns are others than those found."""
    start = replace(job, start=replace(fit, simulated=None))
    again = run_method(begun_at(replace(task, job=start), found), task.method)
    if again.found.fit.columns != found.found.fit.columns:
        return None
    return replace(again, task=replace(again.task, job=job))


def _digits(begun: Begun, unseen: FloatArray | None = None) -> float:
    """Return what is known of all parameters together, a logarithm; unseen reversals move them as given."""
    found, fit = begun.found, begun.found.fit
    moves = (
        timing_moves(begun.task.job, found.observation, fit) if unseen is None else np.outer(unseen, unseen)
    )
    variance = np.maximum(np.diag(hac_covariance(fit) + moves), np.finfo(float).tiny)
    return -0.5 * float(np.sum(np.log(variance)))


def left_a_sample(fit: Fit) -> float:
    """Return what a fit leaves, the mean over its samples: rows may use more of them than those before."""
    return fit.misfit / sum(block.count for block in fit.blocks)


def _moved_by_unseen(begun: Begun) -> FloatArray | None:
    """Return by how much reversals move X, (c,), that rows do not know of; None where that is little.

    A low-passed velocity does not see that a body goes back for a moment: samples there are used, with the
    wrong direction. What sensors read in the simulation of the instruments has no noise, and needs no filter.
    """
    job, fit = begun.task.job, begun.found.fit
    every = begun.found.observation.blocks
    if fit.carried is not None or not fit.simulated or not all(block.in_memory for block in every):
        return None
    # what is negative is simulated as zero: another motion
    if negative_columns(job.model, fit):
        return None
    records = tuple(
        record.edited(_read_directions(job.model, fit.simulated[index])) if index in fit.simulated else record
        for index, record in enumerate(job.records)
    )
    rows = begun.found.observation
    move = _move(fit, with_given_directions(rows, job.model, records, job.choice, job.drop, True), rows)
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit, grown=False)), 0.0))
    return move if np.any(np.abs(move) > TURNS_MOVE * spread) else None


def _move(fit: Fit, other: Observation, rows: Observation) -> FloatArray:
    """Return by how much X of a fit moves, shape (c,), with the directions that other rows hold."""
    x = fit.all_parameters(rows.columns)
    wrong = [
        new.W @ new.own(x) - old.W @ old.own(x)
        for new, old in zip(other.blocks, rows.blocks, strict=True)
        if old.place.size
    ]
    span = Span(fit)
    return np.asarray(span.compared([wrong], span.left).share[:, 0])


def _read_directions(model: Model, record: Record) -> dict[str, FloatArray]:
    """Return the directions of bodies, shape (n,) each, from what their own sensors read without noise."""
    found = {}
    for sensor in model.sensors:
        if sensor.body and sensor.measures in ("position", "velocity") and sensor.key in record.signals:
            read = record.signals[sensor.key]
            speed = np.gradient(read) if sensor.measures == "position" else read
            found[direction_channel(sensor.body)] = np.sign(speed)
    return found


def takes_directions(job: Job) -> bool:
    """Tell whether rows take directions from a simulation: whether they hold signs of speeds."""
    return bool(bodies_with_signs(job.model))


def directed(job: Job, fit: Fit) -> Job:
    """Return a job whose records bring the directions of bodies, of a simulation with a fit's parameters.

    Raises
    ------
    DataError
    IdentifiabilityError
        When the simulation fails.
    """
    late = {channel: delay for channel, delay, _ in fit.delays}
    values = possible(job.model, simulation_parameters(job.model, fit))
    return job.changed(
        partial(_with_directions, model=job.model, values=values, choice=job.choice, loop=job.loop, late=late)
    )


def _with_directions(
    records: tuple[Record, ...],
    model: Model,
    values: Mapping[str, float],
    choice: FilterChoice,
    loop: Loop | None,
    late: Mapping[str, float],
) -> tuple[Record, ...]:
    """Return records with the directions of bodies as channels, of a simulation with physical parameters."""
    found, bodies = [], bodies_with_signs(model)
    for record in records:
        on_time, close = _followed(record, model, values, choice, loop, late)
        found.append(record.edited(directions(close, bodies, on_time)))
    return tuple(found)


def _followed(
    record: Record,
    model: Model,
    values: Mapping[str, float],
    choice: FilterChoice,
    loop: Loop | None,
    late: Mapping[str, float],
) -> tuple[Record, Simulated]:
    """Return a record less its delays, and a simulation that is kept close to it."""
    on_time = advanced(record, late)
    beside = simulated_beside(model, values, on_time, choice, loop)
    return on_time, followed_closely(beside, choice, loop)
