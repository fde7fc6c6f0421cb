"""Leaps of positions and velocities: where samples are missing or readings are wrong; records without them.

A mass does not leap. Where the motion goes on behind a leap as before, the readings between are wrong, and
are interpolated. Where it goes on elsewhere, samples are missing or an encoder has lost steps: a filter or a
simulation across that would see a motion that never was, so that the record is two.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.samples.stuck_readings import equal_runs, faulty_runs, moving_samples
from modelgen.runtime.diagnostics.thresholds import (
    BACK_ON_TRACK,
    BENT,
    LEAP,
    LEAP_RESOLUTIONS,
    LEAP_SPEED,
    LISTED,
    LONGEST_BRIDGED,
    MOST_CUTS,
    OVERLAP,
    SHORTEST_PART,
    USUAL_CHANGES_OF_STEP,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import WHOLE

# Samples on either side that a wrong reading is interpolated from, by a polynomial of this degree.
FITTED, DEGREE = 4, 3
# Samples that are looked at together, and so many steps that show what is usual.
BLOCK, SHOWN = 1 << 14, 1 << 16


@dataclass(frozen=True)
class Leap:
    """A leap of positions: `first` is the last sample before it and `last` the first behind it.

    `back` lists those of the channels `keys` that go on as before.
    """

    first: int
    last: int
    keys: tuple[str, ...]
    back: tuple[str, ...]

    @property
    def bridged(self) -> bool:
        """Whether only readings between are wrong."""
        return self.back == self.keys and self.last - self.first <= LONGEST_BRIDGED


def leaps_of(model: Model, record: Record) -> tuple[Leap, ...]:
    """Return the leaps of a record's positions, those of neighbouring samples as one; worked out once."""
    return record.facts.kept(("leaps", model.channels), lambda: _grouped(record, _found(model, record)))


def without_leaps(model: Model, records: Sequence[Record]) -> tuple[Record, ...]:
    """Return records with wrong readings interpolated, and cut where samples are missing.

    Parts that are much shorter than the longest are left out; a record with many cuts stays in one piece.
    """
    return tuple(part for record in records for part in _parts(record, leaps_of(model, record)))


def told_leaps(model: Model, record: Record) -> Iterator[Advice]:
    """Report leaps, and what is done about them; those of several channels are the clock's."""
    leaps = leaps_of(model, record)
    cut = len(_cuts(leaps)) <= MOST_CUTS
    for leap in leaps[:LISTED]:
        where = f"{record.name}, channel {' and '.join(leap.keys)}, samples {leap.first} to {leap.last}"
        if leap.bridged:
            what = "leaps and comes back: the readings between are wrong, and are interpolated"
            yield Advice("leap", where, what, "check cable and connectors")
        else:
            cause = "the sensor lost steps" if len(leap.keys) == 1 else "the clock jumped"
            done = "; the record is cut there" if cut else ""
            what = f"leaps: samples are missing there, or {cause}{done}"
            yield Advice("leap", where, what, "record again, or give it in parts")
    if len(leaps) > LISTED:
        where = f"{record.name}, samples {leaps[LISTED].first} to {leaps[-1].last}"
        yield Advice("leap", where, f"holds {len(leaps) - LISTED} more leaps", "check how it was recorded")


def _found(model: Model, record: Record) -> list[tuple[int, str, bool]]:
    """Return the samples to which sensors leap, in order, with their channels and whether that is certain.

    Of the others only those that come back are leaps: many wrong readings look like noise, no motion does.
    A velocity bends where a force is switched on, and is certain of nothing else.
    """
    measures = {sensor.key: sensor.measures for sensor in model.sensors if sensor.key in record.signals}
    keys = [key for key in model.channels if measures.get(key) in ("position", "velocity")]
    found, edges = (
        list[tuple[int, str, bool]](),
        np.linspace(0, record.n, -(-record.n // WHOLE) + 1).astype(int),
    )
    for edge, stop in pairwise(edges.tolist()):
        start = max(edge - OVERLAP, 0)
        for key in keys:
            samples = record.read(key, start, stop)
            places, certain = _places(samples)
            if places.size:
                kept = _not_at_faults(record, key, measures, (start, stop), places)
                sure = certain if measures[key] == "position" else ()
                found += [(start + place, key, place in sure) for place in kept]
    return sorted(set(found))


def _places(samples: FloatArray) -> tuple[IntArray, set[int]]:
    """Return the samples to which a sensor may leap, and which of them are unlike nearly all others.

    A step there is unlike its neighbours, and unlike noise.
    """
    none = np.zeros(0, dtype=int)
    if len(samples) < 4:
        return none, set()
    # in blocks that stay in the processor's cache: few records leap
    starts = range(0, len(samples) - 3, BLOCK)
    blocks = [_odd(samples[start : start + BLOCK + 3]) for start in starts]
    shown = np.concatenate([odd[:: -(-len(samples) // SHOWN)] for odd in blocks])
    usual, largest = (LEAP * float(one) for one in np.quantile(shown, USUAL_CHANGES_OF_STEP))
    if max(float(np.max(odd)) for odd in blocks) <= usual:
        return none, set()
    odd, steps = np.concatenate(blocks), np.diff(samples)
    places = np.flatnonzero(odd > max(usual, LEAP_SPEED * float(np.sqrt(np.mean(steps**2)))))
    return places + 2, set((places[odd[places] > largest] + 2).tolist())


def _odd(samples: FloatArray) -> FloatArray:
    """Return by how much each step differs from the mean of its neighbours, shape (n - 3,)."""
    bends = np.diff(samples, 2)
    return 0.5 * np.abs(bends[1:] - bends[:-1])


def _not_at_faults(
    record: Record, key: str, measures: Mapping[str, str], span: tuple[int, int], places: IntArray
) -> list[int]:
    """Return the places that are more than rounding, and not the end of a run that is reported anyway."""
    part = {one: record.read(one, *span) for one in measures if record.facts.extent(one).span > 0.0}
    samples, extent = part[key], record.facts.extent(key)
    runs = equal_runs(samples)
    moving = moving_samples(len(samples), part, measures)
    clipped, stuck = faulty_runs(samples, runs, measures[key], moving, (extent.least, extent.greatest))
    faulty = [*clipped.tolist(), *stuck.tolist()]
    ends = np.concatenate([runs.first[faulty], runs.last[faulty] + 1])
    seen = places[_odd(samples)[places - 2] > LEAP_RESOLUTIONS * runs.resolution]
    return [int(place) for place in seen if not np.any(np.abs(ends - place) <= 1)]


def _grouped(record: Record, found: Sequence[tuple[int, str, bool]]) -> tuple[Leap, ...]:
    groups: list[list[tuple[int, str, bool]]] = []
    for leap in found:
        if groups and leap[0] <= groups[-1][-1][0] + 2:
            groups[-1].append(leap)
        else:
            groups.append([leap])
    leaps = []
    for group in groups:
        first, last, names = group[0][0] - 1, group[-1][0], {name for _, name, _ in group}
        keys = tuple(key for key in record.signals if key in names)
        back = tuple(key for key in keys if _is_back(record, key, first, last))
        one = Leap(first, last, keys, back)
        if one.bridged or any(certain for _, _, certain in group):
            leaps.append(one)
    return tuple(leaps)


def _is_back(record: Record, key: str, first: int, last: int) -> bool:
    """Tell whether a sensor reads behind a leap what its speeds before and behind lead to.

    Where it bends, these speeds differ.
    """
    start, stop = max(first - FITTED, 0), min(last + FITTED + 1, record.n)
    samples = record.read(key, start, stop)
    before, behind = samples[: first - start + 1], samples[last - start :]
    if len(before) < 2 or len(behind) < 2:
        return False
    speeds, steps = (float(np.mean(np.diff(one))) for one in (before, behind)), last - first
    slower, faster = sorted(speeds)
    missed = float(behind[0] - before[-1]) - 0.5 * steps * (slower + faster)
    between = samples[first - start : last - start + 1]
    off = float(np.max(np.abs(between - np.linspace(between[0], between[-1], steps + 1))))
    return abs(missed) < BACK_ON_TRACK * off and faster - slower < BENT * off


def _parts(record: Record, leaps: Sequence[Leap]) -> list[Record]:
    wrong = [leap for leap in leaps if leap.bridged]
    keys = dict.fromkeys(key for leap in wrong for key in leap.keys)
    record = record.edited({key: _bridge(record, key, wrong) for key in keys})
    cuts = _cuts(leaps)
    if not cuts or len(cuts) > MOST_CUTS:
        return [record]
    starts, stops = [0, *(leap.last for leap in cuts)], [*(leap.first + 1 for leap in cuts), record.n]
    spans = list(zip(starts, stops, strict=True))
    longest = max(stop - start for start, stop in spans)
    kept = [(start, stop) for start, stop in spans if stop - start >= SHORTEST_PART * longest]
    return [record.part(start, stop, f"{record.name} from sample {start}") for start, stop in kept]


def _cuts(leaps: Sequence[Leap]) -> list[Leap]:
    return [leap for leap in leaps if not leap.bridged]


def _bridge(record: Record, key: str, leaps: Sequence[Leap]) -> Edit:
    """Return a position with the readings between the ends of leaps interpolated."""
    places, values = list[int](), list[float]()
    for leap in leaps:
        if key not in leap.keys:
            continue
        start, stop = max(leap.first - FITTED + 1, 0), min(leap.last + FITTED, record.n)
        at = np.array([*range(start, leap.first + 1), *range(leap.last, stop)])
        samples = record.read(key, start, stop)[at - start]
        between = np.arange(leap.first + 1, leap.last)
        fitted = np.polynomial.Polynomial.fit(at, samples, min(DEGREE, len(at) - 1))
        places += between.tolist()
        values += fitted(between).tolist()
    wrong, right = np.array(places), np.array(values)

    def make(samples: FloatArray, start: int) -> FloatArray:
        here = (wrong >= start) & (wrong < start + len(samples))
        mended = np.array(samples)
        mended[wrong[here] - start] = right[here]
        return mended

    return Edit(key, make)
