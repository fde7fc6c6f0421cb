"""Instruments with effects estimated from the start on, where nothing comes out without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.identification.explanation.coarse_starts import Start, coarse_starts, zeros_apart
from modelgen.runtime.identification.explanation.explain_residual import explained
from modelgen.runtime.identification.explanation.explain_stretches import long
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    Explained,
    Shown,
    begun_at,
    begun_with,
    exceeding,
    run_method,
    with_carried_effects,
)
from modelgen.runtime.identification.explanation.simulated_directions import (
    explained_with_directions,
    left_a_sample,
    turned,
    with_simulated_directions,
    with_uncertain_turns,
)
from modelgen.runtime.identification.explanation.what_is_left import gained, left_of_each
from modelgen.runtime.identification.explanation.wider_directions import with_wider_directions
from modelgen.runtime.identification.job import Change, Job
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import SHOWN_EFFECTS, TOLD_APART
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import Freed, corrected, fit_with_effects
from modelgen.runtime.iv.physical.alike_bodies import exchanges
from modelgen.runtime.iv.thresholds import AS_GOOD, AS_LIKELY, EFFECT_ROUNDS
from modelgen.runtime.iv.told_effects import estimated
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.nearest_parameters import alike
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import bodies_with_signs, direction_channel, signs_of_rows


def with_starts(task: Task, method: IV) -> Begun | None:
    """Return instruments with zeros of positions, or what is read at other instants, estimated at once.

    Where zeros differ by more than deflections, or a sensor is late by a sample, a link seems to carry a
    force that nothing explains, and nothing comes out without them. What leaves least is taken.
    """
    if all_from_composites(task.model):
        return None
    step("looking for zeros, delays and clocks of sensors")
    job, found = task.job, list[tuple[Start, Freed]]()
    for start in coarse_starts(job):
        try:
            freed = _freed(job, start)
        except (IdentifiabilityError, DataError):
            continue
        found.append((start, freed))
    if not found:
        return None
    # of those that leave as little, the one that needs least for it
    left = left_of_each(job, [(freed.fit, start.effects, freed.at or freed.sizes) for start, freed in found])
    alike = [entry for entry, misfit in zip(found, left, strict=True) if misfit < min(left) + AS_LIKELY]
    start, freed = min(alike, key=lambda entry: len(entry[0].effects))
    none, effects = np.zeros((len(freed.fit.columns),) * 2), start.effects
    told = Explained(freed.observation, freed.fit, effects, freed.sizes, none, ())
    if task.checks.drift_check:
        task, freed = _with_directions(replace(task, method=method), start, freed)
        told = explained(task.job, freed, start.fit, effects)
    else:
        advice = tuple(estimated(one, size, ()) for one, size in zip(effects, freed.sizes, strict=True))
        told = replace(told, advice=advice)
    begun = begun_with(replace(task, method=method), told)
    return with_uncertain_turns(begun) if turned(begun) else begun


def _with_directions(task: Task, start: Start, freed: Freed) -> tuple[Task, Freed]:
    """Return a task and its fit with effects, with directions of bodies as records without these show them.

    What is read behind a slow low-pass turns late, and friction with it: that hides what else is wrong, and
    what a simulation says of directions is of no use before the records are set right. What directions hide
    first is how a low-pass bends: a single lag bends as its delay says.
    """
    best = task, freed
    if not any(signs_of_rows(task.model)):
        return best
    for sizes in dict.fromkeys((freed.sizes, start.lagging(freed.sizes))):
        best = _less(best, _directed(task, start, sizes), start, freed)
    if best[1] is freed:
        return best
    # what was simulated without the effects had friction of its own: once more, with that of the estimate
    return _less(best, _directed(task, start, best[1].sizes, best[1].fit), start, best[1])


def _less(best: tuple[Task, Freed], other: Task | None, start: Start, freed: Freed) -> tuple[Task, Freed]:
    """Return the task and fit that leave less: the best ones, or those of another task, begun at a fit."""
    if other is None:
        return best
    with suppress(IdentifiabilityError, DataError):
        found = _freed(other.job, replace(start, fit=freed.fit, sizes=freed.sizes))
        same = found.fit.columns == freed.fit.columns
        if same and left_a_sample(found.fit) < left_a_sample(best[1].fit):
            return other, found
    return best


def _directed(task: Task, start: Start, sizes: Sequence[float], fit: Fit | None = None) -> Task | None:
    """Return a task whose records bring directions, of effects of these sizes; None where none are better.

    They are simulated at the estimate that knows of the effects, or at a fit.
    """
    apart = task.changed(partial(corrected, delays={}, effects=start.effects, sizes=sizes))
    try:
        plain = with_wider_directions(run_method(apart, task.method))
        if fit is not None and fit.columns == plain.found.fit.columns:
            plain = replace(plain, found=replace(plain.found, fit=fit))
        turned = with_simulated_directions(plain)
    except (IdentifiabilityError, DataError):
        return None
    if turned.found.fit is plain.found.fit:
        return None
    job = turned.task.job
    changes = job.changes[len(task.job.changes) :]
    bring = partial(_bring_directions, model=job.model, changes=changes)
    own = replace(task.job, choice=job.choice, reversing=job.reversing, surveys=()).changed(bring)
    return replace(task, choice=job.choice, job=own)


def _freed(job: Job, start: Start) -> Freed:
    """Return the fit with the effects of a start."""
    effects, sizes = start.effects, start.sizes
    return fit_with_effects(job.setting(), job.calm, start.fit, effects, sizes, job.sharpened, EFFECT_ROUNDS)


def _bring_directions(
    records: tuple[Record, ...], model: Model, changes: Sequence[Change]
) -> tuple[Record, ...]:
    """Return records with the directions of bodies, if any, that changes of them bring."""
    keys, changed = [direction_channel(body) for body in bodies_with_signs(model)], records
    for change in changes:
        changed = change(changed)
    return tuple(
        record.edited({key: other.signals[key] for key in keys if key in other.signals})
        for record, other in zip(records, changed, strict=True)
    )


def with_zeros(task: Task, run: Callable[[Task], Begun]) -> Begun | None:
    """Return instruments in physical parameters with zeros of positions; None where these hardly differ.

    Without them there is no start: springs seem to carry forces that nothing explains. `run` takes a task to
    its estimate.
    """
    if not all_from_composites(task.model) or long(task.job) or task.job.share < 1.0:
        return None
    zeros = zeros_apart(task.job)
    if not zeros.differ:
        return None
    try:
        return run(replace(task, job=replace(task.job, effects=zeros.effects, sizes=zeros.sizes)))
    except (IdentifiabilityError, DataError):
        return None


def with_shown_effects(begun: Begun, holds_known: bool = False) -> Begun:
    """Return instruments in physical parameters with what their residual shows estimated as well.

    One effect after the other, as long as each makes the records clearly more likely, the most likely first;
    the intervals hold what is left, and others that are as likely. Where it is known what is held, the last
    one leaves noise, or none is taken. Other fits have theirs already.
    """
    ties: dict[str, Sequence[tuple[Effect, float]]] = {}
    first, apart = begun, np.zeros((len(begun.found.fit.columns),) * 2)
    for _ in range(SHOWN_EFFECTS):
        if not holds_known and not exceeding(begun):
            break
        found = with_carried_effects(begun.task.job, begun.found)
        known = {effect.name for effect in found.effects}
        # a lag of a force loses the chain where its delay cannot stand in for it: then there is no hold
        any_hold = holds_known or bool(found.fit.unknown)
        shown = [one for one in found.shown if any_hold or not one.like_a_hold]
        tried = [(one, _with(begun, found, one)) for one in shown if one.effect.name not in known]
        better = [(gained(begun, again), one, again) for one, again in tried if again is not None]
        better.sort(key=lambda entry: -entry[0])
        if not better or better[0][0] < AS_GOOD:
            break
        most, one, again = better[0]
        best = _told(again, begun)
        if best is None:
            break
        equal = [entry for entry in better[1:] if most - entry[0] < AS_GOOD]
        ties[one.effect.name] = [(other.effect, other.size) for _, other, _ in equal]
        moves = [again.found.fit.solution.x - best.found.fit.solution.x for *_, again in equal]
        apart = sum((np.outer(move, move) / len(moves) for move in moves), np.zeros_like(apart))
        begun = best
    if holds_known and exceeding(begun):
        return first
    found = with_carried_effects(begun.task.job, begun.found, ties)
    return begun_with(begun.task, replace(found, drift=found.drift + apart, unsolved=found.unsolved + apart))


def with_exchanged_bodies(begun: Begun) -> Begun:
    """Return instruments in physical parameters that know of what fits as well with bodies exchanged.

    The best of both is taken; where the other one is hardly less likely it is among `CarriedOver.others`.
    """
    model = begun.task.model
    for names in exchanges(model):
        fit, carried = begun.found.fit, begun.found.fit.carried
        known = carried.others if carried else ()
        values = fit.physical(model.parameters)
        if carried is None or fit.unknown or values is None:
            return begun
        task = begun_at(begun.task, begun)
        begin = {name: values[names.get(name, name)] for name in values}
        try:
            again = run_method(replace(task, job=replace(task.job, begin=begin)), task.method)
        except (IdentifiabilityError, DataError):
            continue
        other, there = again.found.fit, again.found.fit.physical(model.parameters)
        if other.carried is None or there is None or other.columns != fit.columns or alike(values, there):
            continue
        by = gained(begun, again)
        if by > 0.0:
            carried, there = other.carried, values
            begun = replace(begun, found=replace(begun.found, fit=other, observation=again.found.observation))
        if abs(by) < TOLD_APART:
            carried = replace(carried, others=(*known, there))
            begun = replace(begun, found=replace(begun.found, fit=replace(begun.found.fit, carried=carried)))
    return begun


def _with(begun: Begun, found: Explained, shown: Shown) -> Begun | None:
    """Return instruments in physical parameters with a further effect estimated; None where they fail.

    `found` is what begun found, with the effects that it carries.
    """
    effect = shown.effect
    # a change of shape is linear, and intervals know of it
    effects = (*found.effects, effect, *effect.shape(len(begun.task.records)))
    job = replace(begun.task.job, effects=effects, sizes=(*found.sizes, shown.size))
    try:
        again = run_method(begun_at(replace(begun.task, job=job), begun), begun.task.method)
        again = explained_with_directions(again, begun) if turned(again) else again
    except (IdentifiabilityError, DataError):
        return None
    same = again.found.fit.carried is not None and again.found.fit.columns == begun.found.fit.columns
    return again if same else None


def _told(again: Begun, before: Begun) -> Begun | None:
    """Return what is taken in place of `before` with what its residual shows; None where that fails.

    What is only tried is not asked for that, unless directions of a simulation follow it.
    """
    if turned(again):
        return again
    with suppress(IdentifiabilityError, DataError):
        return explained_with_directions(again, before)
    return None
