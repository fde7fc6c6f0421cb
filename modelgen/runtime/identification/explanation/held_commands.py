"""Forces that are found half a sample early: commands that a drive holds over every sample.

A zero-order hold delays a command by half a sample and averages it over one. The delay is found; the average,
(f / fs)^2 pi^2 / 6 of the force, looks nearly like inertia, and records hardly tell the two apart. What is
half a sample early without a hold would be chance, or a converter in the middle of the period: what that
would move stays in the intervals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import HALF_SAMPLE
from modelgen.runtime.iv.thresholds import AS_GOOD
from modelgen.runtime.least_squares.delays import with_holds


def held_commands(begun: Begun) -> tuple[str, ...]:
    """Return the forces, of those whose delay was to be found, that are early by half a sample."""
    rates = {record.fs for record in begun.task.records}
    found = begun.found
    delays = {channel: delay for channel, delay, _ in found.fit.delays}
    delays |= {
        effect.channel: size
        for effect, size in zip(found.effects, found.sizes, strict=True)
        if effect.kind == "delay"
    }
    if len(rates) > 1:
        return ()
    (fs,) = rates
    late = [key for key in begun.task.job.late if key in delays]
    return tuple(key for key in late if abs(delays[key] * fs + 0.5) < HALF_SAMPLE)


def with_holds_of(task: Task, channels: tuple[str, ...]) -> Task:
    """Return the task with these commands as a hold makes them."""
    records = with_holds(task.records, channels)
    job = replace(task.job, records=records)
    return replace(task, records=records, unseen=with_holds(task.unseen, channels), job=job)


def better_held(begun: Begun, held: Begun, channels: tuple[str, ...]) -> Begun | None:
    """Return the estimate with holds unless it leaves more; what they move is in the intervals.

    The estimate without holds lies at the edge of a 95 % interval. What needs fewer effects may leave a
    little more for each.
    """
    before, after = begun.found.fit, held.found.fit
    fewer = max(0, len(begun.found.effects) - len(held.found.effects))
    more = 0.5 * AS_GOOD * (1 + fewer)  # the misfit is half a chi square
    if before.columns != after.columns or after.misfit > before.misfit + more:
        return None
    half = 0.5 * (after.solution.x - before.solution.x)
    told = tuple(
        Advice(
            "more than the model",
            channel,
            "acts half a sample later than recorded, as a command does that is held over every sample; it is "
            "taken for one, and the intervals hold what else it may be",
            f"name it (--held {channel})",
        )
        for channel in channels
    )
    found = replace(
        held.found, drift=held.found.drift + np.outer(half, half), advice=(*told, *held.found.advice)
    )
    return replace(held, found=found)
