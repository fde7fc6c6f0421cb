"""Channels of elastic arms that are late, off zero or off scale: estimated with least squares, and set right.

No simulation makes instruments of an elastic arm, but its rows say as much: each channel is changed a little,
and what that changes in what rows leave is a column (Gauss and Newton). Springs multiply small differences of
channels by large stiffnesses: half a sample of a force that a drive holds is a damper twice as strong.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.identification.cutoffs.choose_cutoff import part_tried
from modelgen.runtime.identification.elastic.channel_errors import (
    SetRight,
    channel_errors,
    forces_of_drives,
    resolved,
    runs_away,
    set_right,
)
from modelgen.runtime.identification.elastic.command_times import CommandTimes, times_of_commands
from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.identification.elastic.encoder_zeros import EncoderZero, of_other_records
from modelgen.runtime.identification.elastic.force_gains import ForceGain, force_gains
from modelgen.runtime.identification.elastic.joint_effects import Aligned, joint_effects
from modelgen.runtime.identification.elastic.link_forces import link_forces
from modelgen.runtime.identification.elastic.row_forces import RowForce, row_forces
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    ALIGNED_APART,
    ALIGNED_ON,
    ALIGNING_ROUNDS,
    ALIGNMENT_AT_REST,
    AS_LIKELY,
    NEARLY_AT_REST,
    PATIENT_ALIGNING,
    TOLD_APART,
)
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.least_squares.delays import with_holds
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record

Again = Callable[[Task], Task | None]
# A task about the estimate of records that were set right, and by what.
Begun = tuple[Task, dict[Effect, float]]


def with_channels_set_right(
    task: Task, again: Again, known: Collection[str] = ()
) -> tuple[Task, SetRight | None]:
    """Return the task of an elastic arm with records whose channels are on time, at zero and to scale.

    The same task, and None, where rows show nothing that matters. Of long records the middle is looked at.

    Parameters
    ----------
    task : Task
    again : callable
        Gives the task with rows about the estimate of its records, from near by; None where there is none.
    known : collection of str
        Forces that are taken as held already.
    """
    step("looking for channels that are late or off zero")
    parts = tuple(part_tried(record, ALIGNED_ON) for record in task.records)
    job = replace(task.job, records=parts, surveys=(), memory_limit=None)
    tried = replace(task, records=parts, unseen=(), job=job)
    channels = channel_errors(task.model, len(parts))
    every = (
        *channels,
        *force_gains(task.model),
        *row_forces(task.model),
        *link_forces(task.model, len(parts)),
    )
    zeros = tuple(one for one in channels if isinstance(one, EncoderZero))
    begun = _with_zeros(tried, again, zeros)
    found = _come_to_rest(tried, again, every, begun)
    if found is None and zeros:
        found = _come_to_rest(tried, again, zeros, begun)
    looked = None if known or (found is not None and found.commands) else times_of_commands(tried)
    other = None if known else _holding(tried, again, every, (found, begun), looked)
    if other is not None:
        found, task = other, task.changed(partial(with_holds, channels=other.right.held))
    alike = (looked.move,) if looked is not None and looked.alike and other is None else ()
    if found is None:
        return task, SetRight.only(alike) if alike else None
    right = replace(found.right, beyond=(*found.right.beyond, *alike))
    return _corrected(task, found.known, found.task.model), right


def _holding(
    task: Task,
    again: Again,
    every: tuple[Effect, ...],
    near: tuple[Aligned | None, Begun],
    looked: CommandTimes | None,
) -> Aligned | None:
    """Return where steps rest of rows of held commands, if these are as likely as those that are not.

    `near` is what was found without, and what that began with.
    """
    found, begun = near
    candidates = [] if found is None else _held(found)
    if looked is not None and looked.holds:
        candidates = [looked.drives]
    for held in candidates:
        # the average that a hold is looks like inertia
        changed = task.changed(partial(with_holds, channels=held))
        other = None
        if found is not None:
            other = _with_holds(changed, again, every, (found.task, found.known), found.commands)
        if other is None:
            # what was found may have stood for half a sample of another force
            other = _with_holds(changed, again, every, begun)
        # every delay that is free gains a little by noise
        if other is None or other.misfit > _most_left(found, looked):
            continue
        # one that does not hold is late by half a sample as the mean of what it holds
        if not set(held).intersection(other.early):
            return replace(other, right=replace(other.right, held=held))
    return None


def _most_left(found: Aligned | None, looked: CommandTimes | None) -> float:
    """Return what rows of held commands may leave at most, to be as likely as those that are not."""
    if found is not None and found.commands:
        return found.misfit + AS_LIKELY * len(found.commands)
    plain = np.inf if looked is None else looked.plain
    return min(plain, np.inf if found is None else found.misfit) - AS_LIKELY


def _held(found: Aligned) -> list[tuple[str, ...]]:
    """Return forces that may be held commands, likely ones first; none where none is early by half a sample.

    Drives of a machine mostly do the same: one whose noise hides its half sample made a rotor 20 % too light.
    """
    early = found.early
    late = {one.channel for one in found.known if one.kind == "delay"}.difference(early)
    every = (*early, *(key for key in forces_of_drives(found.task.model) if key not in late.union(early)))
    return list(dict.fromkeys((every, early))) if early else []


def _with_zeros(task: Task, again: Again, zeros: Sequence[Effect]) -> Begun:
    """Return the task with zeros of encoders set right that rows show, about its estimate, and the zeros.

    Large ones bend all else: a stiffness that makes the least of them is another one, and may be none.
    """
    known, now = dict.fromkeys(zeros, 0.0), task
    for _ in range(ALIGNING_ROUNDS if zeros else 0):
        rows = EffectRows(now.job, tuple(zeros))
        try:
            fit = rows.solved_at_own_point(zeros)
        except (DataError, IdentifiabilityError):
            break
        spread = dict(zip(fit.columns, np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0)), strict=True))
        sizes = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
        if all(abs(sizes.get(one.name, 0.0)) <= ALIGNED_APART * spread.get(one.name, 0.0) for one in zeros):
            return now, known
        known = {one: size + sizes.get(one.name, 0.0) for one, size in known.items()}
        corrected = _corrected(task, known, now.model)
        now = again(corrected) or corrected
    return task, dict.fromkeys(zeros, 0.0)


def _with_holds(
    task: Task,
    again: Again,
    candidates: tuple[Effect, ...],
    near: Begun,
    commands: Collection[Effect] = (),
) -> Aligned | None:
    """Return where steps rest of the same task with forces held, whose delays are looked for anew.

    Of what was found without, which is `near`, only delays by half a sample, `commands`, are dropped; unless
    there are none: then whatever is found stood for the holds.
    """
    at, every = near
    known = {
        one: size
        for one, size in every.items()
        if isinstance(one, EncoderZero) or (commands and one not in commands)
    }
    corrected = _corrected(task, known, at.model)
    return _come_to_rest(task, again, candidates, (again(corrected) or corrected, known), held=True)


def _come_to_rest(
    task: Task, again: Again, candidates: tuple[Effect, ...], begun: Begun, held: bool = False
) -> Aligned | None:
    """Return where steps of what is off come to rest; None where nothing is, or they do not.

    They begin with a task whose records have been set right, and by what. Of forces that are `held` nothing
    else may be off.
    """
    (now, known), length, before, rests, moves = begun, 1.0, dict[Effect, float](), True, True
    rows = EffectRows(now.job, candidates, read=task.records, undone=known)
    for done in range(ALIGNING_ROUNDS):
        try:
            joint = joint_effects(rows, tuple(known), rests)
        except (DataError, IdentifiabilityError):
            return None
        # a force stays in the rows, and is found anew each time
        stays = {one: known.get(one, 0.0) if isinstance(one, RowForce) else 0.0 for one in joint.effects}
        found = {one: joint.step(one) for one in joint.effects}
        steps = {one: (size - stays[one], std) for one, (size, std) in found.items()}
        looked, share = rests, ALIGNMENT_AT_REST if done < PATIENT_ALIGNING else NEARLY_AT_REST
        # a zero bends rows by its size times what stiffnesses change by: of a few deviations that is nothing
        least = {one: ALIGNED_APART if isinstance(one, EncoderZero) else share for one in steps}
        rests = all(abs(size) < least[one] * std for one, (size, std) in steps.items())
        # what goes to and fro, as other samples are left open, comes to rest with shorter steps
        to_and_fro = (
            sum(size * before.get(one, 0.0) / (std**2 or 1.0) for one, (size, std) in steps.items()) < 0.0
        )
        length = 0.5 * length if to_and_fro else min(1.0, 2.0 * length)
        before = {one: size for one, (size, _) in steps.items()}
        known = {one: known.get(one, 0.0) + length * size for one, size in before.items()}
        right = joint.told(known, held)
        doubtful = _doubtful(known, steps, task.records)
        if rests:
            # noise may be as much of rows as what tells a gain
            gains = [one for one in doubtful if isinstance(one, ForceGain)]
            likelier = [one for one in gains if _likelier_with(one, task, now, rows, known)]
            doubtful = [one for one in doubtful if one not in likelier]
        if rests and doubtful:
            # it stood in for another one, and is not looked for again
            known = {one: size for one, size in known.items() if one is not doubtful[0]}
            rows = rows.without(doubtful[0])
        if (not known and not held) or any(runs_away(*one, task.records) for one in known.items()):
            return None
        if any(not isinstance(one, RowForce) for one in (*known, *doubtful[: int(rests)])):
            corrected = _corrected(task, known, now.model)
            # where springs are hardly known no steps may rest: rows stay about the point that they had
            changed = again(corrected) if moves else None
            now, moves = changed or corrected, changed is not None
            rows = EffectRows(now.job, rows.effects, read=task.records, undone=known, aside=rows.aside)
        if rests and looked and not doubtful:
            return Aligned(now, known, right, joint.fit.misfit)
    return None


def _doubtful(
    known: Mapping[Effect, float], steps: Mapping[Effect, tuple[float, float]], records: Sequence[Record]
) -> list[Effect]:
    """Return what is within few deviations, those of its `steps`, or less than records resolve."""
    told = {one: size for one, size in known.items() if not isinstance(one, EncoderZero)}
    doubtful = [one for one, size in told.items() if abs(size) < ALIGNED_APART * steps[one][1]]
    return [*doubtful, *(one for one, size in told.items() if not resolved(one, size, records))]


def _likelier_with(
    one: Effect, task: Task, now: Task, rows: EffectRows, known: Mapping[Effect, float]
) -> bool:
    """Tell whether rows leave clearly less with an effect that is known, whatever its deviation is."""
    others = {other: size for other, size in known.items() if other is not one}
    without = EffectRows(_corrected(task, others, now.model).job, tuple(others)).solved([*others])
    return without.misfit > rows.solved([*others]).misfit + TOLD_APART


def _corrected(task: Task, sizes: Mapping[Effect, float], model: Model) -> Task:
    """Return the task with channels set right, its rows about the same point as those of a model."""
    own, tails = {record.name for record in task.records}, isinstance(task.checks.hold_out, Real)

    def change(records: tuple[Record, ...]) -> tuple[Record, ...]:
        same = tails or own.issuperset(record.name for record in records)
        known = sizes if same else of_other_records(sizes)
        return tuple(set_right(model, record, index, known) for index, record in enumerate(records))

    changed = task.changed(change)
    job = replace(changed.job, model=model, surveys=(), unaligned=task.job.records)
    return replace(changed, model=model, job=job)
