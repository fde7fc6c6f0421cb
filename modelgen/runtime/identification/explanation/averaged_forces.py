"""Forces that are found late by up to half a sample: means over the time before, as drives report currents.

A mean over a time T is late by half of it, and smaller by (f T)^2 pi^2 / 6 at a frequency f: nearly what less
inertia would be, and records hardly tell whether a force was averaged or is merely late. Where neither leaves
less, the intervals hold both.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.explanation.commands.held_commands import with_held_commands
from modelgen.runtime.identification.explanation.commands.rest_of_commands import rest_of
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    late_forces,
    with_note,
)
from modelgen.runtime.identification.explanation.what_is_left import gained
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import LONGEST_MEAN, SHORTEST_MEAN, WHOLE_SAMPLE
from modelgen.runtime.iv.effect import LOW_PASSES
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import with_holds, with_means_undone

# A current that settles within each sample of its controller bends at all of them, and is read late: a mean
# does the same to second order.
MEAN = (
    "acts as a mean over the time before does, not as the force at its instant, and is taken for that "
    "(a current that settles within each sample of its controller acts alike)"
)
HELD = "is what a drive held over the last sample, not the force at its instant; it is taken for that"


def with_averaged_forces(begun: Begun, run: Callable[[Task], Begun]) -> Begun:
    """Return an estimate with forces taken for means, or for held commands, or intervals that hold these.

    Parameters
    ----------
    begun : Begun
        Without that.
    run : callable
        Takes a task to its estimate. What finds none is no alternative.
    """
    means = averaged_forces(begun) if begun.task.checks.drift_check else {}
    if not means:
        return begun
    least = AS_LIKELY + _of_noise(begun, means)
    others = [
        found
        for found in _alternatives(begun, means, run)
        if _alike(begun, found, means) and _gained(begun, found) > -least
    ]
    best = max(others, key=partial(_gained, begun), default=begun)
    if best is not begun and _gained(begun, best) > least:
        return best
    # one is as likely as the other
    moves = [found.found.fit.solution.x - begun.found.fit.solution.x for found in others]
    if not moves:
        return begun
    late = ", ".join(f"{key} by {0.5 * length:.2g} samples" for key, length in means.items())
    note = f"late as means over the time before are ({late}): the intervals hold what averages move"
    drift = sum((np.outer(move, move) for move in moves), np.zeros_like(begun.found.drift))
    return with_note(begun, note, begun.found.drift + drift / (1 + len(moves)))


def _alternatives(begun: Begun, means: Mapping[str, float], run: Callable[[Task], Begun]) -> Iterator[Begun]:
    """Yield estimates with forces as means; and, where half a sample is missing, as commands a sample ago.

    Of a command that is held, the mean over the last sample is the command before.
    """
    with suppress(IdentifiabilityError, DataError):
        yield _told(run(begun.task.changed(partial(with_means_undone, lengths=means))), means, MEAN)
    whole = tuple(key for key, length in means.items() if abs(length - 1.0) < WHOLE_SAMPLE)
    if whole:
        with suppress(IdentifiabilityError, DataError):
            held = begun.task.changed(partial(with_holds, channels=whole))
            yield _told(with_held_commands(held, run(held), whole, run), whole, HELD)


def _alike(begun: Begun, other: Begun, channels: Collection[str]) -> bool:
    """Tell whether an estimate leaves something of the same rows, and nothing of what it undid."""
    same = begun.found.fit.columns == other.found.fit.columns
    same &= begun.task.choice.cutoff_hz == other.task.choice.cutoff_hz
    return same and not _averaged_again(other, channels)


def _of_noise(begun: Begun, means: Mapping[str, float]) -> float:
    """Return by how much misfits differ because noise of the forces is averaged as well, or the contrary.

    The mean of the logarithm of sin(x) / x up to the cut-off, at most, for every sample of rows with a force.
    """
    width = np.pi * max(means.values()) * begun.task.choice.cutoff_hz / begun.task.records[0].fs
    return sum(block.count for block in begun.found.fit.blocks if block.has_force) * float(width**2) / 18.0


def _gained(begun: Begun, other: Begun) -> float:
    """Return by how much less another estimate leaves; what needs further effects has to for each.

    Rows in which a body vanishes are smaller, and leave less for that alone: what is left counts by the noise
    that each of both gives its rows, in the records as they were.
    """
    further = _estimated(other) - _estimated(begun)
    return gained(begun, other, begun.task.job) - AS_LIKELY * max(further, 0)


def _estimated(begun: Begun) -> int:
    """Return how many effects are estimated; delays of forces are among them, or apart."""
    return len(begun.found.effects) + len(begun.found.fit.delays)


def _averaged_again(begun: Begun, channels: Collection[str]) -> bool:
    """Tell whether a force acts behind an average, or a lag, once it is no mean any more: it was none."""
    sized = zip(begun.found.effects, begun.found.sizes, strict=True)
    return any(
        size < 0.0 and effect.channel in channels and effect.kind in LOW_PASSES for effect, size in sized
    )


def averaged_forces(begun: Begun) -> dict[str, float]:
    """Return the forces whose delay was to be found that may be means, and over how many samples each.

    A drive averages over a sample, or over a part of one where it works faster than it is recorded.
    """
    fs = begun.task.records[0].fs
    # one that shows as a low-pass is estimated already, and means take no steps within a sample
    shown = {effect.channel for effect in begun.found.effects if effect.kind in LOW_PASSES}
    shown |= {key for key in begun.task.job.late for one in begun.task.records if rest_of(key) in one.signals}
    late = {key: by * fs for key, by in late_forces(begun).items() if key not in shown}
    return {key: min(2.0 * by, 1.0) for key, by in late.items() if SHORTEST_MEAN < 2.0 * by < LONGEST_MEAN}


def _told(begun: Begun, channels: Iterable[str], what: str) -> Begun:
    """Return an estimate that says what forces were taken for."""
    remedy = "record the force at the instants of the sensors, and more often than its controller acts"
    told = tuple(Advice("more than the model", channel, what, remedy) for channel in channels)
    return replace(begun, found=replace(begun.found, advice=(*told, *begun.found.advice)))
