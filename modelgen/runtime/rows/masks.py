"""Which samples a row must not use, chunk by chunk of a record.

A mask looks at velocities around a sample, and at one number of the whole record: the speed below which a
mass stands still.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from numbers import Real

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.thresholds import SUPPORT_TOLERANCE
from modelgen.runtime.filters.reversals import reversals, standstills, turns, widen
from modelgen.runtime.filters.thresholds import STANDSTILL_SHARE
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.dropped_friction import dropped_friction
from modelgen.runtime.rows.row_terms import channels_of_rows
from modelgen.runtime.rows.thresholds import (
    DIRECTION_TOLERANCE,
    PERCENTILE,
    SLOW_SHARE,
    STANDSTILL_PERIODS,
    TURN_TOLERANCE,
)


@dataclass(frozen=True)
class Survey:
    """Speeds below which a mass stands still, by the key of the velocity; where forces of each row jump.

    The latter are looked for where samples are left out for them.
    """

    thresholds: Mapping[str, float]
    jumps: tuple[IntArray, ...] | None = None


NOTHING = Survey({})


@dataclass(frozen=True)
class RowMask:
    """The rule of one row: velocities to look at, what of them counts, and how far around it is felt.

    `events` are "reversals", "turns" (reversals with the standstill around them), or "standstills" of at
    least `longest` samples. Longer ones are masked already where "turns" are asked for. Samples that are
    slower than `least`, a speed a key, are masked whatever happens around them; None is a share of the
    fastest motion (`SLOW_SHARE`).
    """

    keys: tuple[str, ...]
    reach: int
    events: str
    longest: int
    least: tuple[float | None, ...] = ()

    @property
    def halo(self) -> int:
        """Samples around a chunk within which velocities matter."""
        return self.reach + (1 if self.events == "reversals" else self.longest) + 1 if self.keys else 0

    def of(self, chunk: Chunk, thresholds: Mapping[str, float]) -> BoolArray:
        """Return which of the chunk's samples kept are masked, shape (count,)."""
        if len(self.keys) != 1:
            return self._of(chunk, thresholds)
        (key,) = self.keys
        channel, smooth = chunk.plan.directions[key]
        how = self, thresholds[key], smooth, chunk.plan.filtering.factor
        return chunk.filtered(channel, how, lambda: self._of(chunk, thresholds))

    def _of(self, chunk: Chunk, thresholds: Mapping[str, float]) -> BoolArray:
        masked = np.zeros(chunk.count, dtype=bool)
        for place, key in enumerate(self.keys):
            low, high = chunk.start - self.halo, chunk.stop + self.halo
            velocity = chunk.direction(key, low, high)
            # beyond the record there is its mirror image: no rest goes on there
            inside = slice(max(-low, 0), min(high, chunk.source.n) - low)
            marked = np.zeros(len(velocity), dtype=bool)
            marked[inside] = self._events(velocity[inside], thresholds[key])
            if marked.any():
                wide = widen(marked, self.reach)[self.halo : -self.halo]
                masked |= wide[:: chunk.plan.filtering.factor]
            if self.least:
                inside = slice(self.halo, len(velocity) - self.halo, chunk.plan.filtering.factor)
                least = self.least[place]
                slow = SLOW_SHARE / STANDSTILL_SHARE * thresholds[key] if least is None else least
                masked |= np.abs(velocity[inside]) < slow
        return masked

    def _events(self, velocity: FloatArray, threshold: float) -> BoolArray:
        if self.events == "standstills":
            return standstills(velocity, self.longest, threshold)
        return (reversals if self.events == "reversals" else turns)(velocity, threshold)


@lru_cache(maxsize=8)  # the rows of a record are made again and again
def row_masks(
    model: Model, choice: FilterChoice, fs: float, rests_open: tuple[int, ...] = ()
) -> tuple[RowMask, ...]:
    """Return the mask of every row, for matched filtering at a sampling frequency in Hz.

    Coulomb friction jumps where a velocity changes sign. A differentiated row drops it and must not use what
    feels a reversal; a row that keeps sign() must not use what feels a long rest. Rows of `rests_open` use
    all but the rest itself: whatever holds a motor there, and a jump under a derivative, is left open
    (`without_uncertain_turns`).
    """
    order, late, shortest = choice.filter_order, _direction_reach(choice, fs), _long_rest(choice, fs)

    def reach(derivative: int) -> int:
        return support_samples(order, choice.cutoff_hz, fs, derivative, SUPPORT_TOLERANCE)

    found, slow = [], dict(choice.slow_speeds)
    for row, info in enumerate(model.rows):
        if info.reversals and row not in rests_open:
            # the row differentiates the friction as often as its order exceeds that of a motion: a jump
            # enters as an impulse, differentiated once less
            far = max(reach(k) for k in range(max(1, info.order - 2))) + late
            found.append(RowMask(tuple(info.reversals), far, "reversals", 1))
        else:
            keys = own_speeds(model, row)
            otherwise = None if model.is_arm else 0.0
            least = tuple(slow.get(key, otherwise) for key in keys) if slow or model.is_arm else ()
            far = 0 if row in rests_open else reach(0) + late
            found.append(RowMask(keys, far, "standstills", shortest, least))
    return tuple(found)


def slow_speeds(model: Model, given: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return the speeds below which samples are left out by the key of the velocity, from those by sensor.

    Raises
    ------
    DataError
        For a sensor whose velocity is in no row's friction, and for a speed that is none.
    """
    places = {signal.key: signal.sensor for signal in model.signals}
    moving = {str(places[key]): key for key in model.direction_keys if places[key] is not None}
    problems = [missing_name("slow_speeds", "sensor", key, moving) for key in given if key not in moving]
    problems += [
        Problem(f"slow_speeds: {key}", f"is {value!r}", "give a speed above 0, in SI")
        for key, value in given.items()
        if not (isinstance(value, Real) and 0.0 < value < np.inf)
    ]
    if problems:
        raise DataError(*problems)
    return tuple((moving[key], float(value)) for key, value in given.items())


def turn_masks(model: Model, choice: FilterChoice, fs: float) -> tuple[RowMask, ...]:
    """Return for every row the mask of what feels a reversal of a velocity whose sign is in the row.

    A sampled sign() changes up to one sample early or late, and the low-passed velocity it is taken from
    crosses zero a little off the true one. Around every reversal this leaves an error that looks like
    friction; it is small against an ordinary residual, but not against the standard deviation of a consistent
    estimate. A moment of rest between two motions the same way is no reversal: whether a velocity falls below
    a threshold there is the filter's doing, and samples must not come and go with it (a long rest is masked
    anyway).
    """
    reach = support_samples(choice.filter_order, choice.cutoff_hz, fs, 0, TURN_TOLERANCE)
    far, longest = reach + _direction_reach(choice, fs), _long_rest(choice, fs)
    return tuple(RowMask(direction_keys(model, row), far, "turns", longest) for row in range(len(model.rows)))


def feels_turns(speed: FloatArray, model: Model, row: int, choice: FilterChoice, fs: float) -> BoolArray:
    """Tell which samples of a record, fs in Hz, let a row feel that a body turns, or stands still around it.

    `speed`, shape (n,) in SI, is that of a body whose friction is not among the columns: see `turn_masks`.
    """
    order = choice.filter_order
    of = range(max(1, model.rows[row].order - 2))  # as in `row_masks`
    reach = max(support_samples(order, choice.cutoff_hz, fs, k, TURN_TOLERANCE) for k in of)
    return widen(turns(speed), reach + _direction_reach(choice, fs))


def calm_masks(
    model: Model, choice: FilterChoice, fs: float, masks: tuple[RowMask, ...], friction: bool
) -> tuple[RowMask, ...]:
    """Return the masks of all rows, then those of what a row leaves out if enough other samples are left.

    The latter are `turn_masks`; with `friction`, which says that whoever solves the rows adds the friction
    that they drop, also what feels a reversal.
    """
    turns = turn_masks(model, choice, fs)
    if not friction:
        return masks + turns
    base, further = [], []
    for row, (mask, turn) in enumerate(zip(masks, turns, strict=True)):
        added = mask.events == "reversals" and bool(dropped_friction(model, row))
        keys = tuple(dict.fromkeys((*mask.keys, *turn.keys)))
        long = replace(mask, events="standstills", longest=turn.longest) if added else mask
        base.append(long)
        further.append(replace(mask, keys=keys) if added else turn)
    return (*base, *further)


def direction_keys(model: Model, row: int) -> tuple[str, ...]:
    """Return the signals whose sign enters a row."""
    return _all_direction_keys(model)[row]


def own_speeds(model: Model, row: int) -> tuple[str, ...]:
    """Return the signals whose signs a row holds, or had before it was differentiated."""
    return tuple(model.rows[row].reversals) or direction_keys(model, row)


@lru_cache(maxsize=8)
def _all_direction_keys(model: Model) -> tuple[tuple[str, ...], ...]:
    features = [feature for feature in model.features if isinstance(feature.of, str)]
    brought = [one.key for one in model.signals if one.sensor is None and one.actuator is None]
    found = []
    for touched in model.regressor_columns:
        used = {key for terms in touched.values() for _, key in terms}
        signs = [str(feature.of) for feature in features if feature.key in used]
        found.append(tuple(dict.fromkeys([*signs, *(key for key in brought if key in used)])))
    return tuple(found)


def _direction_reach(choice: FilterChoice, fs: float) -> int:
    """Return how late, in samples, the low-passed velocity may show a standstill."""
    return support_samples(choice.filter_order, choice.direction_cutoff_hz, fs, 0, DIRECTION_TOLERANCE)


def _long_rest(choice: FilterChoice, fs: float) -> int:
    return int(np.ceil(STANDSTILL_PERIODS * fs / choice.cutoff_hz))


def jump_places(model: Model, record: Record) -> tuple[IntArray, ...]:
    """Return for every row the samples of a record at which one of its forces jumps, shape (jumps,).

    What a force does between two samples is not in its record: at such places row and motion differ.
    """
    forces = {actuator.key for actuator in model.actuators}
    none = np.zeros(0, dtype=np.int64)
    return tuple(
        np.unique(np.concatenate([none, *(record.facts.jumps(key) for key in sorted(channels & forces))]))
        for channels in channels_of_rows(model)
    )


def near_jumps(jumps: IntArray, grid: range, choice: FilterChoice, fs: float) -> BoolArray:
    """Return which samples of a grid feel one of the jumps, shape (grid,); fs in Hz."""
    reach = support_samples(choice.filter_order, choice.cutoff_hz, fs, 0, TURN_TOLERANCE)
    samples = np.asarray(grid)
    first, behind = np.searchsorted(jumps, samples - reach), np.searchsorted(jumps, samples + reach, "right")
    return np.asarray(behind > first)


def standstill_speed(velocities: Iterator[FloatArray], n: int) -> FloatArray:
    """Return the speed below which a mass stands still, shape (1,), from its velocity at n samples.

    It is a share of the 99th percentile of the speed: an exact one, for which only the fastest hundredth of
    the samples is kept.
    """
    index = PERCENTILE * (n - 1)
    low = int(index)
    fastest = np.zeros(0)
    for velocity in velocities:
        speed = np.abs(velocity)
        # once the fastest are known, most of the others need not be looked at again
        least = fastest.min() if len(fastest) == n - low else -np.inf
        fastest = _largest(np.concatenate([fastest, speed[speed > least]]), n - low)
    ordered = np.sort(fastest)
    percentile = ordered[0] + (index - low) * (ordered[min(1, len(ordered) - 1)] - ordered[0])
    return np.array([STANDSTILL_SHARE * percentile])


def _largest(values: FloatArray, count: int) -> FloatArray:
    if len(values) <= count:
        return values
    return np.partition(values, len(values) - count)[len(values) - count :]
