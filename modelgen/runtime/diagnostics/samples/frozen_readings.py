"""Readings that a channel repeats although what it measures goes on: frames that a bus or a logger lost.

A position catches up behind them, at once; and noise does not repeat itself. What other channels repeat
during the same samples was lost with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.diagnostics.samples.stuck_readings import (
    Runs,
    equal_runs,
    faulty_runs,
    moving_samples,
    noisy,
    step_at,
)
from modelgen.runtime.diagnostics.thresholds import (
    CAUGHT_UP,
    FEWEST_FROZEN,
    LEAST_CAUGHT_UP,
    LONGEST_BRIDGED,
    MOST_CAUGHT_UP,
    OVERLAP,
    SELDOM,
    SHORTEST_RUN,
    USUAL_CHANGE_OF_SPEED,
    USUAL_CHANGES,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import WHOLE

# One of so many samples shows what is usual; so many that are looked at together stay in the cache.
SHOWN, BLOCK = 8, 1 << 14

Frozen = tuple[int, int, tuple[str, ...]]


def frozen_readings(model: Model, record: Record) -> list[Frozen]:
    """Return the first and the last sample of readings that are repeated, in order, and in which channels.

    Those that are few enough to be interpolated.
    """
    measures = {s.key: s.measures for s in model.sensors if s.key in record.signals}
    # a sensor that no row needs tells as well what the others lost with it
    given = [key for key in dict.fromkeys((*model.channels, *measures)) if key in record.signals]
    keys = [key for key in given if record.facts.extent(key).span > 0.0]
    found = set[tuple[int, int]]()
    for start, stop in stretches_of(record, LONGEST_BRIDGED + OVERLAP):
        for key in keys:
            samples = record.read(key, start, stop)
            if measures.get(key) == "position":
                runs = _catching_up(samples)
            else:
                runs = _repeated_noise(record, key, measures, (start, stop), samples)
            found |= {(start + first, start + last) for first, last in runs}
    return [(first, last, _alike(record, keys, first, last)) for first, last in sorted(found)]


def stretches_of(record: Record, overlap: int) -> Iterator[tuple[int, int]]:
    """Yield from which to which sample a record is looked through, with so many samples twice."""
    edges = np.linspace(0, record.n, -(-record.n // WHOLE) + 1).astype(int)
    yield from ((max(edge - overlap, 0), stop) for edge, stop in pairwise(edges.tolist()))


def _alike(record: Record, keys: list[str], first: int, last: int) -> tuple[str, ...]:
    """Return which channels have one reading from the first to the last sample."""
    return tuple(key for key in keys if np.ptp(record.read(key, first, last + 1)) == 0.0)


def _catching_up(samples: FloatArray) -> list[tuple[int, int]]:
    """Return from where to where a position, in rad or m, shape (n,), stands for a moment while it moves on.

    The step behind makes up for those that are lacking, and is unlike the steps around it. A mass that sticks
    starts with small steps, and encoders count one step more or less; what jumps farther than the motion
    would have got has leapt.
    """
    if len(samples) < 4:
        return []
    bends = np.abs(samples[2::SHOWN] - 2.0 * samples[1:-1:SHOWN] + samples[:-2:SHOWN])
    unlike = USUAL_CHANGES * float(np.quantile(bends, USUAL_CHANGE_OF_SPEED))
    if not _steps_after_rest(samples, unlike):
        return []
    runs, steps = equal_runs(samples), np.diff(samples)
    before, behind = step_at(steps, runs.first - 1), step_at(steps, runs.last + 1)
    caught, around = np.abs(step_at(steps, runs.last)), np.maximum(np.abs(before), np.abs(behind))
    inside = (runs.first > 0) & (runs.last < len(samples) - 2) & (runs.lengths <= LONGEST_BRIDGED)
    enough = caught - around > max(unlike, LEAST_CAUGHT_UP * runs.resolution)
    enough &= caught > CAUGHT_UP * around
    return _spans(runs, np.flatnonzero(inside & enough & (caught < MOST_CAUGHT_UP * runs.lengths * around)))


def _steps_after_rest(samples: FloatArray, least: float) -> bool:
    """Tell whether a reading that is repeated is followed by a step larger than `least` anywhere."""
    for start in range(0, len(samples) - 2, BLOCK):
        steps = np.diff(samples[start : start + BLOCK + 2])
        if np.any((steps[:-1] == 0.0) & (np.abs(steps[1:]) > least)):
            return True
    return False


def _repeated_noise(
    record: Record, key: str, measures: Mapping[str, str], span: tuple[int, int], samples: FloatArray
) -> list[tuple[int, int]]:
    """Return from where to where a channel with noise, shape (n,), repeats a reading; short ones."""
    equal = samples[1:] == samples[:-1]
    if not np.any(equal[1:] & equal[:-1]) or np.count_nonzero(equal) > SELDOM * len(samples):
        return []
    runs = equal_runs(samples)
    if not noisy(samples, runs):
        return []
    _, stuck = faulty_there(record, key, measures, span, runs, FEWEST_FROZEN)
    short = (runs.lengths[stuck] <= LONGEST_BRIDGED) & (samples[runs.first[stuck]] != 0.0)
    return _spans(runs, stuck[short])


def faulty_there(
    record: Record,
    key: str,
    measures: Mapping[str, str],
    span: tuple[int, int],
    runs: Runs,
    shortest: int = SHORTEST_RUN,
) -> tuple[IntArray, IntArray]:
    """Return which runs of a channel between two samples are clipped, and which stuck, see `faulty_runs`.

    Indices of runs, shape (found,) each.
    """
    part = {one: record.read(one, *span) for one in measures if record.facts.extent(one).span > 0.0}
    samples, extent = record.read(key, *span), record.facts.extent(key)
    moving, ends = moving_samples(len(samples), part, measures), (extent.least, extent.greatest)
    return faulty_runs(samples, runs, measures.get(key, ""), moving, ends, shortest)


def _spans(runs: Runs, which: IntArray) -> list[tuple[int, int]]:
    return list(zip(runs.first[which].tolist(), runs.last[which].tolist(), strict=True))
