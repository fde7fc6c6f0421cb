"""Instruments with effects estimated from the start on, where nothing comes out without them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.identification.explanation.coarse_starts import coarse_starts, zeros_apart
from modelgen.runtime.identification.explanation.explain_residual import explained
from modelgen.runtime.identification.explanation.explain_stretches import long
from modelgen.runtime.identification.explanation.explained import Begun, Explained, begun_with
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import ZERO_APART
from modelgen.runtime.iv.freed_effects import fit_with_effects
from modelgen.runtime.iv.thresholds import AS_LIKELY, EFFECT_ROUNDS
from modelgen.runtime.iv.told_effects import estimated
from modelgen.runtime.parameters.physical_parameters import all_from_composites


def with_starts(task: Task, method: IV) -> Begun | None:
    """Return instruments with zeros of positions, or what is read at other instants, estimated at once.

    Where zeros differ by more than deflections, or a sensor is late by a sample, a link seems to carry a
    force that nothing explains, and nothing comes out without them. What leaves least is taken.
    """
    if all_from_composites(task.model):
        return None
    step("looking for zeros, delays and clocks of sensors")
    job, setting = task.job, task.job.setting()
    found = []
    for start in coarse_starts(job):
        try:
            freed = fit_with_effects(
                setting, job.calm, start.fit, start.effects, start.sizes, job.sharpened, EFFECT_ROUNDS
            )
        except (IdentifiabilityError, DataError):
            continue
        found.append((start, freed))
    if not found:
        return None
    # of those that leave as little, the one that needs least for it
    most = min(freed.fit.misfit for _, freed in found) + AS_LIKELY
    alike = [entry for entry in found if entry[1].fit.misfit < most]
    start, freed = min(alike, key=lambda entry: len(entry[0].effects))
    none, effects = np.zeros((len(freed.fit.columns),) * 2), start.effects
    told = Explained(freed.observation, freed.fit, effects, freed.sizes, none, ())
    if task.checks.drift_check:
        told = explained(job, freed, start.fit, effects)
    else:
        advice = tuple(estimated(one, size, ()) for one, size in zip(effects, freed.sizes, strict=True))
        told = replace(told, advice=advice)
    return begun_with(replace(task, method=method), told)


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


def with_carried_zeros(job: Job, found: Explained) -> Explained:
    """Return a fit in physical parameters with the zeros that were estimated with these, if any were."""
    carried = found.fit.carried
    if carried is None or not carried.zeros:
        return found
    sizes = tuple(size + more for size, (more, _) in zip(job.all_sizes, carried.zeros, strict=True))
    told = tuple(
        estimated(effect, size, ())
        for effect, size, (_, std) in zip(job.effects, sizes, carried.zeros, strict=True)
        if abs(size) > ZERO_APART * std
    )
    return replace(found, effects=job.effects, sizes=sizes, advice=(*told, *found.advice))
