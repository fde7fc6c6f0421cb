"""Directions of motion from a band twice as wide, where rows leave clearly less with those.

Speeds are low-passed at the dynamics, so that noise turns nothing: what moves there is halved, and such a
speed turns at other instants than the body. A wider band has a hundredth of that error, and more noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.settings_drift import other_direction
from modelgen.runtime.filter_choice.explain import direction_sentence
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.cutoffs.choose_cutoff import part_tried
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import CLEARLY_LESS
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.rows.given_directions import signs_of_rows
from modelgen.runtime.rows.masks import direction_keys

# Directions are judged behind no higher a cut-off than so many times their own.
JUDGED_BELOW = 1.5
# Instruments are run with the wider band where their solution already leaves less than this share with it.
LESS_AT_ALL = 0.97
# Joints reverse between samples where that is so much likelier (20 times): the logarithm.
LIKELIER = 3.0


def with_wider_directions(begun: Begun) -> Begun:
    """Return instruments with directions of a band twice as wide, where rows leave less with those.

    As they are otherwise, where the user gave a cut-off for directions, and where every sample feels a
    reversal: a simulation knows better there. Where every sample feels one only in the wider band, the
    narrow one has swallowed reversals.
    """
    task, fit = begun.task, begun.found.fit
    given = task.filters.direction_cutoff_hz is not None or task.filters.directions
    if given or fit.carried is not None or not any(signs_of_rows(task.model)) or fit.turning:
        return begun

    def again(choice: FilterChoice) -> Begun:
        job = replace(task.job, choice=choice, start=fit, surveys=())
        if judge(job, fit) > LESS_AT_ALL:
            return begun  # a simulation less
        return run_method(replace(task, choice=choice, job=job), task.method)

    judge = _judge(task.job, fit)
    lowest_fs = min(record.fs for record in task.records)
    for choice, found in other_direction(task.choice, lowest_fs, again):
        other = found.found.fit
        if found is begun or other.columns != fit.columns:
            continue
        # what uses samples near reversals leaves more for that: the solution there was is judged
        if judge(found.task.job, fit if other.turning else other) > CLEARLY_LESS:
            continue
        before, after = (direction_sentence(one.direction_cutoff_hz, False) for one in (task.choice, choice))
        after = f"{after[:-1]}: rows leave more with a narrower band."
        told = tuple(after if one == before else one for one in choice.sentences)
        choice = replace(choice, sentences=told)
        job = replace(found.task.job, choice=choice, start=task.job.start)
        return replace(found, task=replace(found.task, choice=choice, job=job))
    return begun


def with_turns_between_samples(task: Task) -> Task:
    """Return a task of an arm whose joints reverse between samples, where its rows then leave less.

    A force that follows a smooth motion jumps at a sample; a drive whose force is smooth lets friction bend
    the motion at the instant of the reversal, of which a sampled direction is off by up to half a sample.
    """
    if not any(direction_keys(task.model, row) for row in range(len(task.model.rows))):
        return task
    parts = tuple(part_tried(record) for record in task.records)
    other = task_between(task)
    jobs = [replace(one.job, records=parts, late=(), surveys=(), rows_for_tag=None) for one in (task, other)]
    try:
        at, between = (run_wls(job)[1] for job in jobs)
    except (DataError, IdentifiabilityError):
        return task
    clearly = between.columns == at.columns and between.misfit < at.misfit - LIKELIER
    return other if clearly else task


def task_between(task: Task) -> Task:
    """Return the same task with joints that reverse between samples."""
    choice = replace(task.choice, between=True)
    return replace(task, choice=choice, job=replace(task.job, choice=choice))


def _judge(job: Job, fit: Fit) -> Callable[[Job, Fit], float]:
    """Return what gives the share of what the fit of a job leaves that another job leaves with a fit.

    Behind the fit's cut-off, or a lower one: what late directions leave has an even spectrum, and noise of
    differentiated readings a rising one, which hides it behind a high cut-off.
    """
    cutoff_hz = min(job.choice.cutoff_hz, JUDGED_BELOW * job.choice.direction_cutoff_hz)
    before = _left(job, fit, cutoff_hz, own=True)

    def judge(other: Job, there: Fit) -> float:
        after = _left(other, there, cutoff_hz, own=there is not fit)
        shares = [after[key] / size if size > 0.0 else 1.0 for key, size in before.items() if key in after]
        return float(np.exp(np.mean(np.log(shares)))) if min(shares, default=0.0) > 0.0 else 1.0

    return judge


def _left(job: Job, fit: Fit, cutoff_hz: float, own: bool) -> Mapping[tuple[int, int], float]:
    """Return what rows with directions leave with the solution of a fit, as shares of their largest terms.

    By record and row, behind a cut-off; with `own` the fit is of that job, whose rows are not made again.
    """
    signs = signs_of_rows(job.model)
    if own and job.choice.cutoff_hz <= cutoff_hz:
        blocks, left = fit.blocks, fit.left_shares
    else:
        late = {channel: delay for channel, delay, _ in fit.delays}
        there = replace(job, choice=replace(job.choice, cutoff_hz=cutoff_hz))
        rows = there.calm(tuple(advanced(record, late) for record in job.records))
        x, blocks = fit.all_parameters(rows.columns), rows.blocks
        left = tuple(float(np.linalg.norm(one.residual(x))) / (one.terms_norm(x) or 1.0) for one in blocks)
    pairs = zip(blocks, left, strict=True)
    return {(one.record, one.row): share for one, share in pairs if one.count and signs[one.row]}
