"""Runs of equal readings of one channel: which are of a sensor that stuck, or reached the end of its range.

A mass cannot stop within one sample, so a position that stops at full speed is the sensor's fault; a mass
that sticks slows down first. A sensor with noise cannot read the same number many times in a row. A force or
an acceleration may stand still, but hardly while the machine moves in a record that repeats no other reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.diagnostics.thresholds import (
    ALTERNATING,
    AROUND,
    CALM,
    CERTAIN_CHANCE,
    CHANCE,
    CLIPPED_RUN,
    FULL_SPEED,
    LEAP_AFTER_STUCK,
    MANY_RUNS,
    MOSTLY,
    MOVES,
    MOVES_CLEARLY,
    NEARBY,
    OFTEN,
    RARELY,
    REPEATED,
    REPEATED_NOISE,
    RESOLUTIONS,
    SELDOM,
    SETTLING,
    SHORTEST_RUN,
    SLOWER,
    SPANS,
    STRAIGHT,
    USUAL_CHANGES,
    VISIBLE_NOISE,
)
from modelgen.runtime.filters.rounding import excerpt, rounding


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of two and more equal readings: first and last sample of each, shape (runs,).

    `resolution` is the step of readings that are rounded, 0 if they are not.
    """

    first: IntArray
    last: IntArray
    resolution: float

    @property
    def lengths(self) -> IntArray:
        """Samples of each run, shape (runs,)."""
        return self.last - self.first + 1


def equal_runs(samples: FloatArray) -> Runs:
    """Return the runs of equal readings of a channel that is not constant, in any unit, shape (n,)."""
    changes = samples[1:] != samples[:-1]
    if changes.all():
        none = np.zeros(0, dtype=int)
        return Runs(none, none, rounding(samples))
    edges = np.concatenate([[0], np.flatnonzero(changes) + 1, [len(samples)]])
    long = np.diff(edges) > 1
    return Runs(edges[:-1][long], edges[1:][long] - 1, rounding(samples))


def faulty_runs(
    samples: FloatArray,
    runs: Runs,
    measures: str,
    moving: BoolArray,
    ends: tuple[float, float],
    shortest: int = SHORTEST_RUN,
) -> tuple[IntArray, IntArray]:
    """Return which runs (indices) are clipped readings and which are of a sensor that stuck.

    Parameters
    ----------
    samples : array, shape (n,)
    runs : Runs
    measures : str
        "position", "velocity" or "acceleration"; empty for a force.
    moving : array of bool, shape (n,)
        Where the record's other channels say that the machine moves.
    ends : tuple of float
        Least and greatest reading of the whole record.
    shortest : int
        Readings of a sensor that stuck, at least.
    """
    if not runs.first.size:
        return runs.first, runs.first
    lengths, values = runs.lengths, samples[runs.first]
    extreme = (values == ends[0]) | (values == ends[1])
    long = lengths >= _longest_by_chance(len(samples), lengths, shortest)
    if not measures:  # before a drive is switched on, and after that
        at_ends = (runs.first == 0) | (runs.last == len(samples) - 1)
        long &= (values != 0.0) | ~at_ends
    if noisy(samples, runs):
        short = extreme & (lengths >= CLIPPED_RUN)
        clipped = np.flatnonzero(short & (long | (np.sum(short) > 1)))
        stuck = np.flatnonzero(long & ~extreme)
        stuck = stuck[_not_at_rest(runs, stuck, measures, moving)]
        if measures == "position":
            clipped, stuck = (which[~_slows_down(samples, runs, which)] for which in (clipped, stuck))
        stuck = stuck[~_coarse_there(samples, runs, stuck)]
        return clipped[~_coarse_there(samples, runs, clipped)], stuck
    steps, bends = np.abs(np.diff(samples)), np.abs(np.diff(samples, 2))
    full = _full_speed(steps, bends, runs.resolution)
    # at a limit the step into the run is cut short; the one before it is not
    before = _sudden(steps, bends, runs.first - 2, runs.first - 3, full) | (runs.first == 0)
    after = _sudden(steps, bends, runs.last + 1, runs.last + 1, full) | (runs.last == len(samples) - 1)
    bent = np.maximum(step_at(bends, runs.first - 3), step_at(bends, runs.last + 1)) > STRAIGHT * full
    short = extreme & (lengths >= CLIPPED_RUN)
    clipped = short & bent & ((before & after) | _only_there(short, lengths, len(samples)))
    if measures == "position":
        clipped[clipped] = ~_slows_down(samples, runs, np.flatnonzero(clipped))
    elif not measures and _settles(samples, runs, np.flatnonzero(clipped)):
        clipped[:] = False
    if measures in LEAP_AFTER_STUCK:
        largest = max(full, float(np.quantile(excerpt(steps), 0.99)))
        wrong = step_at(steps, runs.last) > LEAP_AFTER_STUCK[measures] * largest
        if measures == "position":
            wrong |= _sudden(steps, bends, runs.first - 1, runs.first - 2, full)
    else:
        seldom = np.sum(lengths - 1) - (lengths - 1) < SELDOM * len(samples)
        moved = np.concatenate([[0], np.cumsum(moving)])
        wrong = seldom & (moved[runs.last + 1] - moved[runs.first] > MOSTLY * lengths)
        # at a crest the readings of a coarse channel repeat, and do not leap afterwards
        wrong &= (step_at(steps, runs.last) > RESOLUTIONS * runs.resolution) | (runs.last == len(samples) - 1)
        # a body that sticks is not accelerated
        wrong &= (measures != "acceleration") | (values != 0.0)
    return np.flatnonzero(clipped), np.flatnonzero(long & ~clipped & wrong)


def moving_samples(n: int, sensors: Mapping[str, FloatArray], measures: Mapping[str, str]) -> BoolArray:
    """Return at which samples a position changes, or a velocity is not small, shape (n,).

    Over a few samples, so that noise of a sensor is no motion.
    """
    found = np.zeros(n, dtype=bool)
    for key, samples in sensors.items():
        if measures[key] != "acceleration":
            travelled = samples if measures[key] == "position" else np.cumsum(samples)
            around = np.pad(travelled, AROUND, mode="edge")
            speed = np.abs(around[2 * AROUND :] - around[: -2 * AROUND])
            found |= speed > MOVES * float(np.sqrt(np.mean(speed**2)))
    return found


def _coarse_there(samples: FloatArray, runs: Runs, which: IntArray) -> BoolArray:
    """Return around which runs other readings repeat as well: no noise shows there, so they are no fault.

    A file with so many significant digits has coarse readings far from zero and fine ones near it; an axis
    at rest between two counts of its encoder has none of the noise that it shows when it moves. A force that
    settles between the pulses of its controller has none just before its reading rests.
    """
    found = np.zeros(len(which), dtype=bool)
    for index, run in enumerate(which.tolist()):
        first, last = int(runs.first[run]), int(runs.last[run])
        parts = samples[max(first - NEARBY, 0) : first], samples[last + 1 : last + 1 + NEARBY]
        pairs = [(part[1:], part[:-1]) for part in parts]
        other = sum(int(np.sum(later != samples[first])) for later, _ in pairs)
        same = sum(int(np.sum((later == early) & (later != samples[first]))) for later, early in pairs)
        calm = any(
            len(part) == AROUND and _white_noise(part) < CALM * runs.resolution
            for part in (parts[0][-AROUND:], parts[1][:AROUND])
        )
        found[index] = calm or same > REPEATED * max(other, 1)
    return found


def _not_at_rest(runs: Runs, which: IntArray, measures: str, moving: BoolArray) -> BoolArray:
    """Return during which runs, or next to which, the machine moves: readings still at rest are no fault."""
    first, last = runs.first[which], runs.last[which]
    moved = np.concatenate([[0], np.cumsum(moving)])
    during = moved[last + 1] - moved[first] > MOSTLY * (last + 1 - first)
    if measures not in ("position", "velocity"):
        return np.asarray(during)
    n = len(moving)
    before = moved[first] > moved[np.maximum(first - AROUND, 0)]
    after = moved[np.minimum(last + 1 + AROUND, n)] > moved[last + 1]
    return np.asarray(during | before | after)


def _slows_down(samples: FloatArray, runs: Runs, which: IntArray) -> BoolArray:
    """Return before which runs of a position a mass slows down: there it sticks, and no sensor does.

    A reading that was filtered or resampled shows noise in motion and none at rest. The times that are
    compared are the shortest in which more moves than noise does.
    """
    found, least = np.ones(len(which), dtype=bool), MOVES_CLEARLY * _white_noise(samples)
    for index, run in enumerate(which.tolist()):
        first = int(runs.first[run])
        for span in (AROUND << times for times in range(SPANS)):
            here, before, earlier = samples[np.maximum(first - span * np.arange(3), 0)]
            if abs(before - earlier) > least:
                found[index] = abs(here - before) < SLOWER * abs(before - earlier)
                break
    return found


def _settles(samples: FloatArray, runs: Runs, which: IntArray) -> bool:
    """Tell whether a force mostly comes to rest by itself, as behind a current loop after a step.

    What is cut off at a limit runs into it as fast as before, but where it vibrates fast.
    """
    found, least = np.zeros(len(which), dtype=bool), RESOLUTIONS * runs.resolution
    for span in SETTLING:
        here, before, earlier = samples[np.maximum(runs.first[which] - span * np.arange(3)[:, None], 0)]
        moved = np.abs(before - earlier)
        found |= (moved > least) & (np.abs(here - before) < SLOWER * moved)
    lengths = runs.lengths[which]
    return bool(np.sum(lengths[found]) > 0.5 * np.sum(lengths))


def _only_there(short: BoolArray, lengths: IntArray, n: int) -> bool:
    """Return whether readings repeat at the ends of the range, hardly elsewhere, not as in a square wave."""
    there, elsewhere = int(np.sum(short)), int(np.sum(~short & (lengths >= CLIPPED_RUN)))
    return bool(there >= OFTEN and elsewhere <= RARELY * there and np.sum(lengths[short]) < 0.5 * n)


def _longest_by_chance(n: int, lengths: IntArray, shortest: int) -> float:
    """Return the length from which on a run does not come about by itself.

    How often neighbours are equal is counted without the longest run: it may be the fault that is looked for.
    Where many runs show it, so is how often two equal ones are followed by a third: noise does not care, a
    force between the pulses of its controller does.
    """
    equal = float(np.sum(lengths - 1) - (lengths.max(initial=1) - 1)) / n
    if len(lengths) >= MANY_RUNS:
        equal = max(equal, float(np.mean(lengths > 2)))
    if equal <= 0.0:
        return float(shortest)
    return max(float(shortest), 1.0 + float(np.log(CHANCE / n) / np.log(min(equal, 0.999))))


def noisy(samples: FloatArray, runs: Runs) -> bool:
    """Return whether readings, shape (n,), in any unit, have noise larger than their resolution.

    They then hardly ever repeat: a force between the pulses of a controller that feels the counts of its
    encoder, or between the steps of a binary command, does so often.
    """
    alone = len(samples) - int(np.sum(runs.lengths - 1))  # readings and runs, each counted once
    by_chance = REPEATED_NOISE**2 * alone
    if np.sum(runs.lengths >= CLIPPED_RUN) > by_chance + CERTAIN_CHANCE * np.sqrt(by_chance):
        return False
    fourth = np.diff(excerpt(samples), 4)
    fourth = fourth[fourth != 0.0]
    if len(fourth) < SHORTEST_RUN:
        return False
    alternating = float(np.mean(fourth[1:] * fourth[:-1] < 0.0))
    return alternating > ALTERNATING and _white_noise(samples) > VISIBLE_NOISE * runs.resolution


def _white_noise(samples: FloatArray) -> float:
    """Return the standard deviation of noise of readings, if it is white; what repeats counts for nothing."""
    fourth = np.diff(excerpt(samples), 4)
    changing = np.abs(fourth[fourth != 0.0])
    return float(np.median(changing)) / (0.6745 * np.sqrt(70.0)) if changing.size else 0.0


def _full_speed(steps: FloatArray, bends: FloatArray, resolution: float) -> float:
    """Return the step that no mass makes just before it stops."""
    rms = float(np.sqrt(np.mean(steps[steps > 0.0] ** 2)))
    usual = float(np.quantile(excerpt(bends), 0.95)) if bends.size else 0.0
    return max(FULL_SPEED * rms, RESOLUTIONS * resolution, USUAL_CHANGES * usual)


def _sudden(steps: FloatArray, bends: FloatArray, step: IntArray, bend: IntArray, full: float) -> BoolArray:
    """Return which steps are at full speed and do not change as they would if something slowed down there."""
    found = step_at(steps, step)
    return np.asarray((found > full) & (found > USUAL_CHANGES * step_at(bends, bend)))


def step_at(steps: FloatArray, places: IntArray) -> FloatArray:
    """Return the steps, in any unit, shape (n,), at these places; 0 beyond the ends."""
    inside = (places >= 0) & (places < len(steps))
    return np.where(inside, steps[np.where(inside, places, 0)], 0.0) if steps.size else np.zeros(len(places))
