"""Forces that are found half a sample early: commands that a drive holds over every sample.

A zero-order hold delays a command by half a sample and averages it over one. The delay is found; the average,
(f / fs)^2 pi^2 / 6 of the force, looks nearly like inertia, and records hardly tell the two apart. What is
half a sample early without a hold would be chance, or a converter in the middle of the period: what that
would move stays in the intervals where the hold does not leave less.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from math import log

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.explanation.best_cutoff import at_cutoff_of
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    Explained,
    begun_at,
    delays_of,
    late_forces,
)
from modelgen.runtime.identification.explanation.held_images import without_images
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    CLEARLY_LESS,
    HALF_SAMPLE,
    HELD_ROUNDS,
    HELD_SETTLED,
    LEAST_BEFORE,
)
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import with_holds


def with_held_commands(task: Task, first: Begun, told: Sequence[str], run: Callable[[Task], Begun]) -> Begun:
    """Return an estimate with commands as a drive holds them, without what their images add to the sensors.

    Parameters
    ----------
    task : Task
    first : Begun
        Its estimate, without regard to images.
    told : sequence of str
        Forces that are known to be held: the task has them as a hold makes them. Otherwise they are looked
        for.
    run : callable
        Takes a task to its estimate. Where it finds none, what was estimated first stays.
    """
    if told:
        held = {key: delays_of(first).get(key, 0.0) for key in told}
    else:
        held = held_commands(first) if first.task.checks.drift_check else {}
        task = _holding(task, tuple(held))
    task, known = at_cutoff_of(task, first.task), first
    for _ in range(HELD_ROUNDS if held else 0):
        try:
            again = run(begun_at(without_images(task, held, known), known))
        except (IdentifiabilityError, DataError):
            return first
        # images feel when the command changes, which shows only without them
        late = {key: delays_of(again).get(key, delay) for key, delay in held.items()}
        moved = max(abs(late[key] - held[key]) * again.task.records[0].fs for key in held)
        known, held = again, late
        if moved < HELD_SETTLED:
            break
    if told or known is first:
        return known
    if not all(_follows(known, key, late) for key, late in held.items()):
        return first
    return better_held(first, known, held) or first


def held_commands(begun: Begun) -> dict[str, float]:
    """Return the forces whose delay was to be found that are early by half a sample, or one and a half.

    With each by how many s it is late beside a hold: what is computed in one period may act in the next.
    """
    fs = begun.task.records[0].fs
    beside = {key: late + 0.5 / fs for key, late in late_forces(begun).items()}
    return {
        key: late
        for key, late in beside.items()
        if late * fs < HALF_SAMPLE and abs(late * fs - round(late * fs)) < HALF_SAMPLE
    }


def _follows(begun: Begun, key: str, late: float) -> bool:
    """Tell whether a command can be held, and late by so many s beside that.

    A lag that is estimated beside the hold is late, too: together they cannot take longer than the command
    does, which acts after it is given. Where they do, the lag alone is what was taken for a hold. A low-pass
    in the reading of what is held undoes the hold.
    """
    found, fs = begun.found, begun.task.records[0].fs
    sizes = {
        effect: size
        for effect, size in zip(found.effects, found.sizes, strict=True)
        if effect.channel == key and effect.kind in ("lag", "average")
    }
    lag = sum(effect.samples(size, fs) for effect, size in sizes.items() if effect.kind == "lag")
    return all(size < 0.0 for size in sizes.values()) and -late * fs > lag - LEAST_BEFORE


def _holding(task: Task, channels: tuple[str, ...]) -> Task:
    return task.changed(partial(with_holds, channels=channels))


def _late_as_effect(before: Explained, after: Explained, channels: Collection[str]) -> bool:
    """Tell whether holds stand for delays that are effects, and need no other ones.

    They are effects where rows use samples near reversals: directions that change late move them there, and
    what they take off is no evidence against a hold.
    """
    late = {one.name for one in before.effects if one.kind == "delay" and one.channel in channels}
    names, kept = ({one.name for one in found.effects} for found in (before, after))
    return bool(late) and kept <= names


def better_held(begun: Begun, held: Begun, channels: Collection[str]) -> Begun | None:
    """Return the estimate with holds unless it leaves more.

    What the holds move is in the intervals, unless they leave clearly less, or as little with fewer effects:
    the estimate without holds lies at the edge of a 95 % interval. What needs fewer effects may leave a
    little more for each; what needs more of them has to leave less.
    """
    before, after = begun.found.fit, held.found.fit
    fewer = len(begun.found.effects) - len(held.found.effects)
    allowed = AS_LIKELY * (1 + fewer if fewer >= 0 else fewer)
    if _late_as_effect(begun.found, held.found, channels):
        allowed = max(allowed, -log(CLEARLY_LESS) * before.count)
    if before.columns != after.columns or after.misfit > before.misfit + allowed:
        return None
    half = 0.5 * (after.solution.x - before.solution.x)
    certain = after.misfit < before.misfit - AS_LIKELY * (0 if fewer > 0 else 1 - fewer)
    what = (
        "acts half a sample later than recorded, as a command does that is held over every sample; it is "
        "taken for one"
    )
    if not certain:
        what += ", and the intervals hold what else it may be"
    told = tuple(
        Advice("more than the model", channel, what, f"name it (--held {channel})") for channel in channels
    )
    found = held.found
    drift = found.drift if certain else found.drift + np.outer(half, half)
    return replace(held, found=replace(found, drift=drift, advice=(*told, *found.advice)))
