"""Leaps of positions and velocities: where samples are missing or readings are wrong; records without them.

A mass does not leap. Nor does it stand for a few samples and then take up its motion where that would be by
now: frames of a bus were lost, of one channel or of all. Where the motion goes on behind as before, the
readings between are wrong, and few of them are interpolated. Where it goes on elsewhere, samples are missing
or an encoder has lost steps: a filter or a simulation across that would see a motion that never was, so that
the record is two.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.samples.frozen_readings import (
    BLOCK,
    faulty_there,
    frozen_readings,
    stretches_of,
)
from modelgen.runtime.diagnostics.samples.stuck_readings import equal_runs
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

# Samples on either side that wrong readings are interpolated from, by a polynomial of this degree: of a wave
# of 16 samples it misses 0.1 % where five are wrong, and makes noise twice as large there. Forces are not as
# smooth.
FITTED, DEGREE, DEGREE_OF_FORCES = 8, 9, 3
# Samples that show the speed on either side.
NEXT = 4
# So many steps show what is usual.
SHOWN = 1 << 16


@dataclass(frozen=True)
class Leap:
    """A leap of positions: `first` is the last sample before it and `last` the first behind it.

    `back` lists those of the channels `keys` that go on as before. With `frozen` these only repeat a reading.
    """

    first: int
    last: int
    keys: tuple[str, ...]
    back: tuple[str, ...]
    frozen: bool = False

    @property
    def bridged(self) -> bool:
        """Whether only readings between are wrong."""
        return self.back == self.keys and self.last - self.first <= LONGEST_BRIDGED


def leaps_of(model: Model, record: Record) -> tuple[Leap, ...]:
    """Return the leaps of a record's positions, those of neighbouring samples as one; worked out once."""
    return record.facts.kept(("leaps", model.channels), lambda: _all_leaps(model, record))


def without_leaps(model: Model, records: Sequence[Record]) -> tuple[Record, ...]:
    """Return records with wrong readings interpolated, and cut where samples are missing.

    Parts that are much shorter than the longest are left out; a record with many cuts stays in one piece.
    """
    sensors = [sensor.key for sensor in model.sensors]
    return tuple(part for record in records for part in _parts(record, leaps_of(model, record), sensors))


def told_leaps(model: Model, record: Record) -> Iterator[Advice]:
    """Report leaps, and what is done about them; those of several channels are the clock's."""
    leaps = leaps_of(model, record)
    cut = len(_cuts(leaps)) <= MOST_CUTS
    for leap in leaps[:LISTED]:
        where = f"{record.name}, channel {' and '.join(leap.keys)}, samples {leap.first} to {leap.last}"
        if leap.frozen:
            what = "stands still, and catches up with the motion behind: these readings are interpolated"
            yield Advice("leap", where, what, "check whether the bus or the logger loses frames")
        elif leap.bridged:
            what = "leaps and comes back: the readings between are wrong, and are interpolated"
            yield Advice("leap", where, what, "check cable and connectors")
        else:
            cause = "the sensor lost steps" if len(leap.keys) == 1 else "the clock jumped"
            done = "; the record is cut there" if cut else ""
            what = f"leaps: samples are missing there, or {cause}{done}"
            yield Advice("leap", where, what, "record again, or give it in parts")
    if len(leaps) > LISTED:
        where = f"{record.name}, samples {leaps[LISTED].first} to {leaps[-1].last}"
        more = len(leaps) - LISTED
        what = f"holds {more} more {'leap' if more == 1 else 'leaps'}"
        yield Advice("leap", where, what, "check how it was recorded")


def _all_leaps(model: Model, record: Record) -> tuple[Leap, ...]:
    """Return the leaps of a record, and where readings were frozen, which leaps end."""
    frozen = [
        Leap(first, last + 1, keys, keys, frozen=True) for first, last, keys in frozen_readings(model, record)
    ]
    leaps = [
        leap
        for leap in _grouped(record, _found(model, record))
        if not any(one.first <= leap.last and leap.first <= one.last for one in frozen)
    ]
    return tuple(sorted([*leaps, *frozen], key=lambda leap: leap.first))


def _found(model: Model, record: Record) -> list[tuple[int, str, bool]]:
    """Return the samples to which sensors leap, in order, with their channels and whether that is certain.

    Of the others only those that come back are leaps: many wrong readings look like noise, no motion does.
    A velocity bends where a force is switched on, and is certain of nothing else.
    """
    measures = {sensor.key: sensor.measures for sensor in model.sensors if sensor.key in record.signals}
    keys = [key for key in model.channels if measures.get(key) in ("position", "velocity")]
    found = list[tuple[int, str, bool]]()
    for start, stop in stretches_of(record, OVERLAP):
        for key in keys:
            samples = record.read(key, start, stop)
            places, certain = _places(samples)
            if places.size:
                kept = _not_at_faults(record, key, measures, (start, stop), places)
                sure = certain if measures[key] == "position" else ()
                found += [(start + place, key, place in sure and not faulty) for place, faulty in kept]
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
) -> list[tuple[int, bool]]:
    """Return the places that are more than rounding, and whether a run that is reported ends at each."""
    samples = record.read(key, *span)
    runs = equal_runs(samples)
    clipped, stuck = faulty_there(record, key, measures, span, runs)
    faulty = [*clipped.tolist(), *stuck.tolist()]
    ends = np.concatenate([runs.first[faulty], runs.last[faulty] + 1])
    seen = places[_odd(samples)[places - 2] > LEAP_RESOLUTIONS * runs.resolution]
    return [(int(place), bool(np.any(np.abs(ends - place) <= 1))) for place in seen]


def _grouped(record: Record, found: Sequence[tuple[int, str, bool]]) -> tuple[Leap, ...]:
    groups: list[list[tuple[int, str, bool]]] = []
    for leap in found:
        if groups and leap[0] <= groups[-1][-1][0] + 2:
            groups[-1].append(leap)
        else:
            groups.append([leap])
    leaps = []
    for place, group in enumerate(groups):
        first, last, names = group[0][0] - 1, group[-1][0], {name for _, name, _ in group}
        # what is read next to another leap says nothing of this one
        low = max(first - NEXT, 0, *(one[-1][0] for one in groups[max(place - 1, 0) : place]))
        high = min(last + NEXT, record.n - 1, *(one[0][0] - 1 for one in groups[place + 1 : place + 2]))
        keys = tuple(key for key in record.signals if key in names)
        back = tuple(key for key in keys if _is_back(record, key, (low, first, last, high)))
        one = Leap(first, last, keys, back)
        if one.bridged or any(certain for _, _, certain in group):
            leaps.append(one)
    return tuple(leaps)


def _is_back(record: Record, key: str, span: tuple[int, int, int, int]) -> bool:
    """Tell whether a sensor reads behind a leap what its speeds before and behind lead to.

    Where it bends, these speeds differ. `span` is from where on they are seen, the samples between which it
    leaps, and up to which sample they are seen.
    """
    start, first, last, final = span
    samples = record.read(key, start, final + 1)
    before, behind = samples[: first - start + 1], samples[last - start :]
    if len(before) < 2 or len(behind) < 2:
        return False
    speeds, steps = (float(np.mean(np.diff(one))) for one in (before, behind)), last - first
    slower, faster = sorted(speeds)
    missed = float(behind[0] - before[-1]) - 0.5 * steps * (slower + faster)
    between = samples[first - start : last - start + 1]
    off = float(np.max(np.abs(between - np.linspace(between[0], between[-1], steps + 1))))
    return abs(missed) < BACK_ON_TRACK * off and faster - slower < BENT * off


def _parts(record: Record, leaps: Sequence[Leap], sensors: Collection[str]) -> list[Record]:
    wrong = [leap for leap in leaps if leap.bridged]
    keys = dict.fromkeys(key for leap in wrong for key in leap.keys)
    degrees = {key: DEGREE if key in sensors else DEGREE_OF_FORCES for key in keys}
    record = record.edited({key: _bridge(record, key, wrong, degrees[key]) for key in keys})
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


def _bridge(record: Record, key: str, leaps: Sequence[Leap], degree: int) -> Edit:
    """Return a channel with the readings between the ends of leaps interpolated."""
    places, values = list[int](), list[float]()
    here = [leap for leap in leaps if key in leap.keys]
    known = np.ones(record.n, dtype=bool)
    for leap in here:
        known[leap.first + 1 : leap.last] = False
    for leap in here:
        start, stop = max(leap.first - FITTED + 1, 0), min(leap.last + FITTED, record.n)
        at = start + np.flatnonzero(known[start:stop])
        fewer = min(int(np.sum(at <= leap.first)), int(np.sum(at >= leap.last)))
        if not at.size:  # all about it is wrong
            continue
        between = np.arange(leap.first + 1, leap.last)
        samples = record.read(key, start, stop)[at - start]
        fitted = np.polynomial.Polynomial.fit(at, samples, min(degree, max(2 * fewer - 1, 0)))
        places += between.tolist()
        values += fitted(between).tolist()
    wrong, right = np.array(places), np.array(values)

    def make(samples: FloatArray, start: int) -> FloatArray:
        here = (wrong >= start) & (wrong < start + len(samples))
        mended = np.array(samples)
        mended[wrong[here] - start] = right[here]
        return mended

    return Edit(key, make)
