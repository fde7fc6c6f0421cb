"""Least squares in place of instruments that the default has found, or has not."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.noise_bias import noise_bias
from modelgen.runtime.diagnostics.parameter_checks import null_columns
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.contradiction import contradiction
from modelgen.runtime.identification.cutoffs.choose_cutoff import with_predicted_cutoff
from modelgen.runtime.identification.explanation.explain_stretches import (
    in_stretches,
    long,
    timing_by_stretches,
)
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    run_method,
    with_note,
)
from modelgen.runtime.identification.explanation.other_weights import other_weights
from modelgen.runtime.identification.explanation.simulated_directions import (
    directed,
    takes_directions,
    with_uncertain_turns,
)
from modelgen.runtime.identification.explanation.what_is_left import left_less
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.memory_limit import beyond_limit
from modelgen.runtime.identification.methods import IV, WLS, Auto, Method
from modelgen.runtime.identification.refusals import all_refused, refusals, refused_problems
from modelgen.runtime.identification.swapped_channels import or_swapped
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    BIAS_SHARE,
    CLEARLY_LESS,
    FAR_LESS,
    LATE_CLEARLY,
    LEFT_SHARE,
    STANDS_IN,
)
from modelgen.runtime.iv.effect import LATE
from modelgen.runtime.iv.freed_effects import corrected
from modelgen.runtime.iv.told_effects import held_instead
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.parameters.bounds import impossible_columns, negative_columns


def least_squares_instead(
    task: Task, method: Auto, first: Begun, driven: FloatArray | None = None
) -> Begun | None:
    """Return least squares where noise of the sensors hardly biases it; None where it does.

    Where a model is wrong its simulation is, too: the measured motion is the better regressor then. What the
    two methods differ by widens the intervals, and so do effects that instruments hold. Where noise of the
    forces biases instruments by `driven`, in SI, shape (c,), that is taken off them first, and they count for
    effects that only they have estimated.
    """
    iv = first.found
    late = {effect: size for effect, size in zip(iv.effects, iv.sizes, strict=True) if effect.kind in LATE}
    inside = partial(corrected, delays={}, effects=late, sizes=tuple(late.values()))
    job = replace(task.job.changed(inside), late=())
    try:
        job, plain = _run(task, job, method.least_squares, iv.fit)
    except (IdentifiabilityError, DataError):
        return None
    fit = plain.found.fit
    bias = noise_bias(task.model, task.records, task.choice, fit)
    spread = np.sqrt(job.share * np.maximum(np.diag(hac_covariance(fit)), 0.0))
    worse = max(fit.left_shares) > max(LEFT_SHARE, *iv.fit.left_shares)
    # what leaves clearly more without a mass that is estimated is no alternative to it, nor what leaves far
    # more without other effects: they are the cause then, and do not stand in for several
    left, least = (float(np.exp(one.misfit / one.count)) for one in (fit, iv.fit))
    masses = [effect for effect in iv.effects if effect.moved is not None]
    worse |= bool(masses) and CLEARLY_LESS * left > least
    worse |= len(late) < len(iv.effects) and FAR_LESS * left > least
    worse |= bool(null_columns(fit, task.model, task.records, task.choice))
    if worse or fit.columns != iv.fit.columns or np.any(np.abs(bias) > BIAS_SHARE * spread):
        return None
    move = contradiction(fit, _less(iv.fit, driven), job.share)
    if driven is not None and len(late) == len(iv.effects):
        move = np.zeros(len(spread))
    why = (
        "the residual is more than noise of the sensors, which"
        if driven is None
        else ("noise of the forces biases instruments, and that of the sensors")
    )
    note = f"method wls: {why} hardly biases least squares here"
    if np.any(move):
        with np.errstate(divide="ignore"):
            share = np.abs(move / fit.solution.x)
        most = int(np.argmax(share))
        note += (
            f"; instruments differ (most in {fit.columns[most]}, by {100.0 * share[most]:.2g} %), and the "
            "intervals are widened by that"
        )
    found = replace(plain.found, advice=held_instead(iv.advice, late))
    weighed, _ = other_weights(task.job, fit)
    timing = timing_by_stretches(replace(job, late=task.job.late), method.least_squares, plain.found)
    drift = found.drift + np.outer(move, move) + iv.unsolved + weighed + timing
    return with_note(replace(plain, found=found), note, drift)


def _less(fit: Fit, driven: FloatArray | None) -> Fit:
    """Return a fit less what noise of the forces shifts it by, in SI, shape (c,), if that is known."""
    if driven is None:
        return fit
    return replace(fit, solution=replace(fit.solution, x=fit.solution.x - driven))


def least_squares_of_long_arm(task: Task, method: Auto, plain: Begun) -> Begun | None:
    """Return least squares of long records of an arm, with what delays move; None where it does not do.

    Instruments keep their rows and those of a simulation, least squares makes rows again. It does where noise
    of the sensors hardly biases it, and instruments of stretches find no force late.
    """
    fit = plain.found.fit
    if not long(task.job):
        return None
    bias = noise_bias(task.model, task.records, task.choice, fit)
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    if np.any(np.abs(bias) > BIAS_SHARE * spread):
        return None
    drift: FloatArray | None = plain.found.drift
    if task.job.late:
        calm = with_predicted_cutoff(task, consistent=True).choice
        drift = _late_by_stretches(task.job, calm, method.instrumental, method.least_squares)
    if drift is None or drift.shape != plain.found.drift.shape:
        return None
    late = "; delays are not estimated, stretches show none" if task.job.late else ""
    return with_note(plain, f"method wls: noise of the sensors hardly biases these long records{late}", drift)


def stand_in(
    task: Task, method: Auto, error: IdentifiabilityError | DataError, why: str | None = None
) -> Begun:
    """Return least squares where instruments find nothing, if it can be trusted; else raise that error."""
    if task.job.guessed:  # only a simulation knows these directions
        raise error
    why = why or f"instruments find nothing ({error.problems[0].what})"
    # without the samples that feel a reversal, where memory holds that: a body that sticks has a friction of
    # any size, and no instruments tell how much that matters
    turns = beyond_limit(task.job, method.instrumental) is not None
    try:
        found = run_method(replace(task, job=replace(task.job, late=(), turns=turns)), method.least_squares)
    except (IdentifiabilityError, DataError):
        raise error from None
    fit = found.found.fit
    refused, _ = refusals(task.model, task.records, task.choice, fit, task.checks.keep)
    if all(name in refused for name in fit.columns):
        raise all_refused(refused, task.model) from None
    bias = noise_bias(task.model, task.records, task.choice, fit)
    impossible = {*negative_columns(task.model, fit), *impossible_columns(task.model, fit)} - refused.keys()
    biased = np.any(np.abs(bias) > STANDS_IN * np.abs(fit.solution.x))
    if biased or impossible or max(fit.left_shares) > LEFT_SHARE:
        reasons = refused_problems(refused, task.model)
        raise or_swapped(IdentifiabilityError(*error.problems, *reasons), task.job, fit) from None
    note, drift = f"method wls: {why}; noise pulls it little", found.found.drift + np.outer(bias, bias)
    if not turns:
        drift = drift + timing_by_stretches(replace(task.job, turns=False), method.least_squares, found.found)
    return with_note(found, note, drift)


def _run(task: Task, job: Job, method: Method, fit: Fit) -> tuple[Job, Begun]:
    """Return least squares, and its job, with directions near reversals simulated at a fit.

    With low-passed directions where those leave more, as that of a wrong model knows none; without samples
    near reversals where the simulation fails. Long records keep those of low-passed speeds: to simulate all
    of one takes as long as all else together, and what other directions move is in the intervals.
    """
    plain = run_method(replace(task, job=job), method)
    if job.share < 1.0 or not takes_directions(job):
        return job, plain
    with suppress(IdentifiabilityError, DataError):
        turned = directed(job, fit)
        found = run_method(replace(task, job=turned), method)
        better = left_less(plain.found.fit, found.found.fit) >= 0.0
        return (turned, with_uncertain_turns(found)) if better else (job, plain)
    calm = replace(job, turns=False)
    return calm, run_method(replace(task, job=calm), method)


def _late_by_stretches(job: Job, choice: FilterChoice, method: IV, plain: WLS) -> FloatArray | None:
    """Return what delays of forces move that least squares of long records does not estimate, (c, c).

    A mean square in SI: by how much `plain` moves on stretches where forces are late by what instruments with
    the filters `choice` find there, or by its deviation. None where these tell that a force is late, or find
    nothing.
    """
    try:
        fit = method.run(in_stretches(replace(job, choice=choice))[0])[1]
        if any(abs(delay) > LATE_CLEARLY * std for _, delay, std in fit.delays):
            return None
        parts = replace(in_stretches(job)[0], late=())
        still = plain.run(parts)[1]
        moves = []
        for channel, delay, std in fit.delays:
            late = tuple(advanced(record, {channel: max(abs(delay), std)}) for record in parts.records)
            moves.append(plain.run(replace(parts, records=late))[1].solution.x - still.solution.x)
    except (IdentifiabilityError, DataError):
        return None
    return sum((np.outer(move, move) for move in moves), np.zeros((len(still.columns),) * 2))
