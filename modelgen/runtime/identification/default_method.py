"""What the default method becomes: instruments, or least squares where these find nothing."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.diagnostics.unforced_rows import zero_columns
from modelgen.runtime.identification.contradiction import below_zero
from modelgen.runtime.identification.cutoffs.choose_cutoff import with_predicted_cutoff
from modelgen.runtime.identification.explanation.averaged_forces import with_averaged_forces
from modelgen.runtime.identification.explanation.best_cutoff import (
    at_best_cutoff,
    at_cutoff_of,
    at_white_cutoff,
    calmer,
)
from modelgen.runtime.identification.explanation.commands import held_commands
from modelgen.runtime.identification.explanation.commands.felt_commands import with_readings_at_changes
from modelgen.runtime.identification.explanation.explain_stretches import (
    decided_by_stretches,
    explained_by_stretches,
    long,
)
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    exceeding,
    run_method,
    unexplained,
    with_note,
)
from modelgen.runtime.identification.explanation.from_starts import (
    with_exchanged_bodies,
    with_shown_effects,
    with_starts,
    with_zeros,
)
from modelgen.runtime.identification.explanation.least_squares_instead import (
    least_squares_instead,
    least_squares_of_long_arm,
    stand_in,
)
from modelgen.runtime.identification.explanation.less_driven import driven_by_noise
from modelgen.runtime.identification.explanation.simulated_directions import (
    explained_with_directions,
    with_simulated_directions,
)
from modelgen.runtime.identification.explanation.what_is_left import gained
from modelgen.runtime.identification.explanation.wider_directions import with_wider_directions
from modelgen.runtime.identification.memory_limit import beyond_limit
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.refusals import refused_problems
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    FAR_OVER_NOISE,
    KEPT_OF_FILES_MB,
    LEFT_BY_ARMS,
    MEGABYTE,
    TELLS_MORE,
)
from modelgen.runtime.iv.thresholds import AS_GOOD
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.parameters.bounds import negative_columns
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.parameters.thresholds import BEYOND_CHANCE
from modelgen.runtime.rows.dropped_friction import dropped_friction
from modelgen.runtime.simulation.arms.arm_coordinates import follows


def default_method(task: Task, method: Auto) -> Begun:
    """Return a task with the method run that the default becomes.

    Raises
    ------
    DataError
        When a record is too short for the filter.
    IdentifiabilityError
        When the records answer none of the parameters.
    """
    if method.rows == "power":
        begun = run_method(replace(task, job=replace(task.job, late=())), method.least_squares)
        return with_note(begun, "method wls: rows of power have no instruments; delays are not estimated")
    if task.model.is_arm:
        return _of_arm(task, method)
    if (beyond := beyond_limit(task.job, method.instrumental)) is not None:
        why = "instruments take more than memory_limit_mb; delays are not estimated"
        return stand_in(with_predicted_cutoff(task, consistent=False), method, DataError(beyond), why)
    of_chain = partial(with_readings_at_changes, method=method, decide=_of_chain)
    if long(task.job):
        of_all = partial(_of_all, method=method)
        return decided_by_stretches(task, with_predicted_cutoff(task, consistent=True), of_chain, of_all)
    return of_chain(task)


def _of_all(begun: Begun, method: Auto) -> Begun:
    """Return what stretches decided, run on all samples; from other starts where that is too little."""
    if not isinstance(begun.task.method, IV):
        return begun
    job = replace(begun.task.job, effects=(), sizes=())
    found = _or_from_starts(replace(begun.task, job=job), method.instrumental, begun)
    return begun if found is begun else with_note(found, begun.found.fit.notes[0])


def _of_chain(task: Task, method: Auto) -> Begun:
    """Return instruments of a chain, or least squares where it is better."""
    given, task = task, with_predicted_cutoff(task, consistent=True)
    try:
        first = _with_all_rows(_instrumental(task, method.instrumental))
    except (IdentifiabilityError, DataError) as error:
        other = with_predicted_cutoff(given, consistent=False)
        left = {one.choice.cutoff_hz: one for one in (other, given)}
        left.pop(task.choice.cutoff_hz, None)
        found = _with_added_friction(task, method) or _first_of(left.values(), method)
        if found is None:
            try:
                return _last_resort(other, method, error)
            except (IdentifiabilityError, DataError):
                found = _first_of(calmer(given), method)
                if found is None:
                    raise
        first, task = found, at_cutoff_of(other, found.task)
    first = _with_all_samples(task, method, first)
    task = replace(task, job=replace(task.job, physical=first.task.job.physical))
    plain, first = first, _with_holds(task, method, first)
    task = first.task
    if first.found.fit.carried is not None:
        run = partial(_instrumental, method=method.instrumental)
        first = at_white_cutoff(given, first, lambda other: _with_holds(other, method, run(other)))
        first = held_commands.with_shown_or_held(plain, first) if task.checks.drift_check else first
        return with_note(with_exchanged_bodies(first), "method iv, in the physical parameters")
    if not exceeding(first):
        return _less_driven(task, method, first)
    found = least_squares_instead(task, method, first)
    return found or with_note(first, "method iv; the residual is more than noise of the sensors")


def _with_holds(task: Task, method: Auto, first: Begun) -> Begun:
    """Return instruments with commands as a drive holds them, and forces as it averages them."""
    run = partial(_instrumental, method=method.instrumental)
    return with_averaged_forces(held_commands.with_held_commands(task, first, method.held, run), run)


def _below(one: Begun) -> float:
    return max(below_zero(one.task.model, one.found.fit, one.found.drift).values(), default=0.0)


def _first_of(tasks: Iterable[Task], method: Auto) -> Begun | None:
    """Return instruments of the first task in which they find something."""
    for task in tasks:
        with suppress(IdentifiabilityError, DataError):
            return _with_all_rows(_instrumental(task, method.instrumental))
    return None


def _with_added_friction(task: Task, method: Auto) -> Begun | None:
    """Return instruments in physical steps, which add friction that rows drop; None where they fail.

    Rows that differentiate friction leave out what feels a reversal: of motion that reverses all the time,
    all that tells a stiffness.
    """
    model, job = task.model, task.job
    known = len(model.identifiable) == len(model.parameters) and not model.composites and job.share == 1.0
    if not known or not any(dropped_friction(model, row) for row in range(len(model.rows))):
        return None
    found = _first_of((replace(task, job=replace(job, physical=True)),), method)
    return None if found is None or unexplained(found) else found


def _with_all_samples(task: Task, method: Auto, first: Begun) -> Begun:
    """Return instruments; where rows are not used, those that add friction if they tell more."""
    if len(first.found.fit.blocks) == len(task.job.records) * len(task.model.rows):
        return first
    found = _with_added_friction(task, method)
    return first if found is None or _spread(found) > TELLS_MORE * _spread(first) else found


def _spread(one: Begun) -> float:
    """Return the largest relative standard deviation of a parameter."""
    fit = one.found.fit
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit) + one.found.drift), 0.0))
    return float(np.max(spread / np.maximum(np.abs(fit.solution.x), float(np.finfo(float).tiny))))


def _with_all_rows(found: Begun) -> Begun:
    """Return a fit; raise where zero solves one of its rows: another cut-off may show what moves there."""
    model, job = found.task.model, found.task.job
    if lost := zero_columns(found.found.fit, model, recorded=(job.records, job.choice)):
        raise IdentifiabilityError(*refused_problems(lost, model))
    return found


def _of_arm(task: Task, method: Auto) -> Begun:
    """Return instruments of an arm; least squares where they find nothing, or noise is not what is left."""
    job = replace(task.job, late=())
    if job.memory_limit is None and not all(record.in_memory for record in job.records):
        job = replace(job, memory_limit=MEGABYTE * KEPT_OF_FILES_MB)
    plain = replace(task, job=job)
    if not follows(task.model):
        plain = with_predicted_cutoff(plain, consistent=False)
    begun, why = run_method(plain, method.least_squares), "instruments take more than memory_limit_mb"
    if not follows(task.model):
        from modelgen.runtime.identification.elastic.aligned_channels import with_notes_of_springs

        return with_notes_of_springs(begun)
    if exceeding(begun, LEFT_BY_ARMS, FAR_OVER_NOISE):
        why = "the residual is far more than noise of the sensors"
    elif (found := least_squares_of_long_arm(task, method, begun)) is not None:
        return found
    elif beyond_limit(task.job, method.instrumental) is None:
        calm = with_predicted_cutoff(task, consistent=True)
        # slow motion may not tell the delays, and the parameters all the same
        for late in dict.fromkeys((calm.job.late, ())):
            try:
                found = run_method(replace(calm, job=replace(calm.job, late=late)), method.instrumental)
            except (IdentifiabilityError, DataError) as error:
                nothing = error.problems[0].what
                why = f"instruments find nothing ({nothing})"
                continue
            if not exceeding(found):
                told = "" if late == calm.job.late else f"; delays are not estimated ({nothing})"
                return with_note(found, f"method iv: noise of the sensors does not bias instruments{told}")
            why = "the residual is more than noise of the sensors"
            break
    return with_note(begun, f"method wls: {why}; delays are not estimated")


def _less_driven(task: Task, method: Auto, first: Begun) -> Begun:
    """Return instruments; least squares where noise of the forces biases these, and of the sensors not it."""
    driven = driven_by_noise(first.task.job, method.instrumental, first.found.fit)
    found = least_squares_instead(task, method, first, driven.shift) if np.any(driven.shift) else None
    first = replace(first, driven=driven)
    return found or with_note(first, "method iv: noise of the sensors does not bias instruments")


def _instrumental(task: Task, method: IV) -> Begun:
    """Return instruments; where a row is left unexplained, with zeros or delays of sensors as well."""
    if (found := with_zeros(task, partial(_explained, method=method))) is not None:
        return found
    try:
        plain = _explained(task, method)
    except IdentifiabilityError:
        found = None if task.job.share < 1.0 else _from_starts(task, method)
        if found is None:
            raise
        return found
    return _or_from_starts(at_cutoff_of(task, plain.task), method, plain)


def _from_starts(task: Task, method: IV) -> Begun | None:
    """Return instruments with effects estimated from the start on; None where they find nothing."""
    try:
        return with_starts(task, method)
    except (IdentifiabilityError, DataError):
        return None


def _or_from_starts(task: Task, method: IV, plain: Begun) -> Begun:
    """Return instruments, or those with effects from the start on where these explain more."""
    doubtful = unexplained(plain) or _below(plain) > BEYOND_CHANCE
    if doubtful and task.job.share < 1.0:
        raise IdentifiabilityError.at("stretches", "leave too much unexplained", "look at all samples")
    found = _from_starts(task, method) if task.checks.drift_check and doubtful else None
    if found is None:
        return plain
    # what is impossible explains rows by terms that cancel each other, of which little is left
    possible = [_below(one) < BEYOND_CHANCE for one in (plain, found)]
    better = gained(plain, found) > AS_GOOD
    return found if possible[1] > possible[0] or (better and possible[1] == possible[0]) else plain


def _explained(task: Task, method: IV) -> Begun:
    """Return a task with instruments run, and what the residual says."""
    if not task.checks.drift_check:
        return run_method(task, method)
    step("looking for what the model lacks")
    if long(task.job):
        return explained_by_stretches(task, method, partial(_explained, method=method))
    begun = with_simulated_directions(with_wider_directions(at_best_cutoff(run_method(task, method))))
    return with_shown_effects(explained_with_directions(begun))


def _last_resort(task: Task, method: Auto, error: IdentifiabilityError | DataError) -> Begun:
    """Return least squares where instruments find nothing, else instruments that use reversals; or raise."""
    try:
        return stand_in(task, method, error)
    except (IdentifiabilityError, DataError):
        if all_from_composites(task.model):
            raise
        task = replace(task, job=replace(task.job, reversing=True))
        found = _first_of((task,), method)
        found = found and _with_holds(task, method, found)
        if found is None or unexplained(found) or negative_columns(task.model, found.found.fit):
            raise
    return with_note(found, "method iv, samples that feel a reversal included: others tell nothing")
