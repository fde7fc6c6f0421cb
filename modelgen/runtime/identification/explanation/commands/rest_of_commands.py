"""What a command is beside its steps: what a controller adds, and holds for a part of a sample at most.

A binary or stepped command is held; feedback of a controller that is faster than the record acts between
samples, which hold some of it only.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.thresholds import LEAST_APART
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.freed_effects import fit_with_effects
from modelgen.runtime.iv.model_errors import delay_effect


class LaterRest(NamedTuple):
    """By how many halves of a sample what a command is beside its steps acts later, and its deviation."""

    later: float
    std: float


def rest_of(channel: str) -> str:
    """Return the channel that holds a force without the steps that it takes."""
    return f"rest of {channel}"


def _later_rest(channel: str) -> Effect:
    """Return that what a force is beside its steps acts later, by half a sample per unit of size.

    Of records that hold it as well: a controller holds what it adds to a command until it acts again.
    """
    name, words = f"controller of {channel}", f"what {channel} is beside its steps acts"
    remedy = f"record {channel} as often as its controller acts"

    def changes(simulated: Simulated) -> Changes:
        record = simulated.measured
        if record is None or rest_of(channel) not in record.signals:
            return {}
        return {channel: 0.5 * np.gradient(record.signals[rest_of(channel)])}

    return Effect(name, "rest", f"{words} later", f"{words} earlier", remedy, changes, channel)


def rest_unseen(begun: Begun, late: Mapping[str, float]) -> dict[str, LaterRest]:
    """Return by how much later what commands are beside their steps acts, before anything is seen of that.

    An analogue controller holds it not at all, one as fast as the record over a sample, and all between is as
    likely. `late` is by how many samples the steps are recorded late: what acts between two samples is read
    at the next one, and the rest at once. Fits in physical parameters take it as analogue.
    """
    if begun.found.fit.carried is not None:
        return {key: LaterRest(2.0 * between_samples(by), 0.0) for key, by in late.items()}
    most = {key: 1.0 + 2.0 * between_samples(by) for key, by in late.items()}
    return {key: LaterRest(0.5 * one, one / 12.0**0.5) for key, one in most.items()}


def rest_seen(begun: Begun, rest: Mapping[str, LaterRest], late: Mapping[str, float]) -> dict[str, LaterRest]:
    """Return the same as an estimate shows it, whose records have the rest as much later as `rest` says.

    Feedback of position and speed is nearly a sum of the columns: only what else a controller adds tells it.
    """
    job, found, known = begun.task.job, begun.found, rest_unseen(begun, late)
    if found.fit.carried is not None:
        return known
    # where every sample is near a reversal no delay is estimated, which moves what acts later as well
    open_ = [key for key in rest if key in job.late and key not in {one for one, *_ in found.fit.delays}]
    more = [one for one in map(delay_effect, open_) if one.name not in {own.name for own in found.effects}]
    effects = (*found.effects, *more, *map(_later_rest, rest))
    sizes = (*found.sizes, *[0.0] * (len(more) + len(rest)))
    try:
        freed = fit_with_effects(job.setting(), job.calm, found.fit, effects, sizes, job.sharpened)
    except (IdentifiabilityError, DataError):
        return known
    for key, size, std in zip(rest, freed.sizes[-len(rest) :], freed.stds[-len(rest) :], strict=True):
        told, before = 1.0 / max(std, LEAST_APART) ** 2, 1.0 / known[key].std ** 2
        mean = (told * (rest[key].later + size) + before * known[key].later) / (told + before)
        known[key] = LaterRest(min(max(mean, 0.0), 2.0 * known[key].later), (told + before) ** -0.5)
    return known


def held_for(later: float, late: float) -> float:
    """Return over how many samples a controller holds what acts by so many halves of one later."""
    return min(max(later - 2.0 * between_samples(late), 0.0), 1.0)


def between_samples(late: float) -> float:
    """Return how long before its sample a step acts that is recorded late by so many, where that is why."""
    return late if 0.0 < late < 1.0 else 0.0
