"""Samples at which rows do not tell the direction of a motor: forces there are left open.

Near a reversal the sign of a speed is that of a part of a sample, and of none where the motor sticks: for
some samples friction is whatever holds it. The speed of a motor that no sensor sees has the wrong sign where
noise, or the low-pass in front of the sign, moves its crossing over a sample. Where that happens at each
reversal, friction, and through it springs and inertias, come out wrong by what intervals hardly hold. Rows
whose forces are open at such samples (`open_forces`) do not depend on them.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.fused_operator import fused_operator
from modelgen.runtime.model.arm_channels import differentiated
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.left_open.held_speeds import (
    moved_by_friction,
    moving_positions,
    rests_can_be_open,
    speeds_of_sensors,
)
from modelgen.runtime.rows.left_open.open_forces import (
    OpenForces,
    joined,
    least_certain,
    pulses_of,
    with_open_forces,
)
from modelgen.runtime.rows.masks import direction_keys
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import RecordRows, full_rate, unmasked_rows
from modelgen.runtime.rows.row_block import STRETCH, RowBlock
from modelgen.runtime.rows.thresholds import (
    CLEARLY_MOVING,
    HIGHEST_WIDER,
    MOST_OPEN,
    MOST_UNCERTAIN,
    NO_SIGN,
    WIDER_BAND,
)

#: Samples, and by how many of its errors the speed is off zero there, shape (s,) each.
Near = tuple[IntArray, FloatArray]


def without_uncertain_turns(
    observation: Observation,
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int,
    turns: bool = True,
) -> Observation:
    """Return rows of an arm that do not depend on directions which speeds do not tell.

    Speeds that rows give count about an estimate only, with the directions of samples, and not in rows that
    are made again whenever they are asked for.

    Parameters
    ----------
    observation : Observation
        Of the records.
    model : Model
    records : sequence of Record
    choice : FilterChoice
    drop : int
        As for `observe`.
    turns : bool
        Whether the rows use samples that feel a reversal; without them, sensors tell all directions.
    """
    if not leaves_turns_open(model):
        return observation
    found = list(observation.blocks)
    for index, record in enumerate(records):
        own = {
            k: _uncertain_directions(model, one, turns or one.turning)
            for k, one in enumerate(found)
            if one.record == index and one.count
        }
        if not any(own.values()):
            continue
        factor = choice.decimation[index]
        rows = unmasked_rows(model, record, choice, factor, drop)
        near = _near_reversals(rows, choice, frozenset().union(*own.values()))
        for k, names in own.items():
            lines = [near[name] for name in names]
            if not lines:
                continue
            own_way = bool(direction_keys(model, found[k].row))
            measured = own_way and all(name in rows.plan.directions for name in names)
            row, rests, turning = found[k].row, _NO_SAMPLES, joined(lines)
            pulses = pulses_of(rows, choice, _felt_orders(model, row), _lags(model, row))
            if rests_can_be_open(model, row):
                used = rows.grid[0] + factor * found[k].place
                rests, turning = _rests_and_turns(turning, used, factor, pulses.shape[1] // 2)
            samples, certain = turning
            most = _most_open(samples[certain < NO_SIGN] // factor, found[k].count, measured)
            if model.rows[row].reversals:
                # no column of the row holds what friction jumps by
                most = len(samples)
            samples = np.union1d(rests, least_certain(samples, certain, factor, most))
            forces = OpenForces(samples, pulses, rows.grid[0], factor)
            found[k] = with_open_forces(found[k], forces, STRETCH)
    return replace(observation, blocks=tuple(found))


def _rests_and_turns(near: Near, used: IntArray, factor: int, reach: int) -> tuple[IntArray, Near]:
    """Return samples of rests at which forces are left open, and those of turns that may be.

    Of both only what one of the samples used, shape (n,) and `factor` apart, feels within `reach`. A row uses
    no sample of a long rest: open forces there, whole, take no more of it than the rest does by itself.
    """
    samples, certain = near
    first, behind = np.searchsorted(used, samples - reach), np.searchsorted(used, samples + reach, "right")
    turning = np.isin((samples - used[0]) // factor, (used - used[0]) // factor)
    resting, turning = ~turning & (behind > first), turning & (behind > first)
    rests = least_certain(samples[resting], certain[resting], factor, len(samples))
    return rests, (samples[turning], certain[turning])


def _most_open(no_sign: IntArray, count: int, measured: bool) -> int:
    """Return at how many points of a row's `count` forces may be left open.

    `no_sign`, shape (s,), are intervals in which a speed has any sign. Where a row holds directions, all
    `measured`, a mask leaves rests out besides.
    """
    share = MOST_UNCERTAIN if measured else MOST_OPEN
    return min(max(int(share * count), len(np.unique(no_sign))), int(MOST_OPEN * count))


def leaves_turns_open(model: Model) -> bool:
    """Tell whether rows of a model hold directions that may be left open."""
    kernel, rows = model.kernel, range(len(model.rows))
    if isinstance(kernel, DeflectedKernel) and kernel.sampled and kernel.speeds:
        return True
    return any(speeds_of_sensors(model, row) for row in rows)


def _felt_orders(model: Model, row: int) -> tuple[int, ...]:
    """Return which derivatives of a force that is off a row feels.

    One that moves a position is felt in the highest derivative of that, of which the row holds inertia times
    force over stiffness; the lower ones are slow against a pulse. A row that is differentiated feels a jump
    as a pulse, differentiated once less.
    """
    kernel, info = model.kernel, model.rows[row]
    if info.reversals:
        return (info.differentiated - 1,)
    if not isinstance(kernel, DeflectedKernel) or not moved_by_friction(model, row):
        return (0,)
    of = {differentiated(one.channel, order): order for one in kernel.giving for order in (1, 2)}
    sums = [terms for key, terms in kernel.sums.items() if kernel.places[key][0] == row]
    highest = max((of.get(name, 0) for terms in sums for _, name in terms), default=0)
    if any(kernel.places[key][0] == row for key in kernel.kernel.keys):
        highest = 2
    return tuple(dict.fromkeys((0, highest) if direction_keys(model, row) else (highest,)))


def _lags(model: Model, row: int) -> tuple[float, ...]:
    """Return by how many s positions that springs give in a row lag behind the force that moves them."""
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel) or not moved_by_friction(model, row):
        return (0.0,)
    return tuple(kernel.spring(one)[1] for one in moving_positions(model, row))


def _uncertain_directions(model: Model, block: RowBlock, turns: bool) -> tuple[str, ...]:
    """Return keys of measured speeds, and names of those that rows give, whose signs a block holds.

    `turns` says that it uses samples that feel a reversal.
    """
    kernel, measured = model.kernel, speeds_of_sensors(model, block.row) if turns else ()
    if not isinstance(kernel, DeflectedKernel) or not kernel.sampled or not block.in_memory:
        return measured
    used = {key for terms in model.regressor_columns[block.row].values() for _, key in terms}
    held = {term for key in used for _, term in kernel.sums.get(key, ())}
    ways = ("sign", "forward", "backward")
    given = (one.name for one in kernel.speeds if held.intersection(f"{way} {one.name}" for way in ways))
    return (*measured, *given)


def _near_reversals(rows: RecordRows, choice: FilterChoice, names: Container[str]) -> dict[str, Near]:
    """Return where each speed is within some of its errors of zero, by its name.

    An error is what a wider band changes: noise, several times as much of it, and what the low-pass takes; or
    what the speed changes by in a part of a sample.
    """
    every, wider = (_every_sample(rows, choice, band) for band in (1.0, WIDER_BAND))
    found: dict[str, Near] = {}
    inside = range(rows.grid[0], rows.grid[-1] + 1)
    for name, (_, smooth) in every.plan.directions.items():
        if name in names:
            found[name] = _NOWHERE if smooth is None else _near(every, wider, name, inside)
    kernel = rows.plan.model.kernel
    if isinstance(kernel, DeflectedKernel) and any(one.name in names for one in kernel.speeds):
        for name, speed in _given_speeds(every).items():
            narrow, wide = (_low_passed(one, speed) for one in (every, wider))
            around = round(0.5 * rows.source.fs / choice.direction_cutoff_hz)
            found[name] = _within(narrow, _error(wide - narrow, inside, around), -1)
    return found


_NO_SAMPLES: IntArray = np.zeros(0, dtype=np.int64)
_NOWHERE: Near = _NO_SAMPLES, np.zeros(0)


def _every_sample(rows: RecordRows, choice: FilterChoice, band: float) -> RecordRows:
    """Return rows at all samples of a record, with directions of a band so many times as wide."""
    source, hertz = rows.source, choice.direction_cutoff_hz
    wide_hz = max(hertz, min(band * hertz, HIGHEST_WIDER * source.fs))
    choice, grid = replace(choice, direction_cutoff_hz=wide_hz), rows.grid
    plan = unmasked_rows(rows.plan.model, source, choice, grid.step, grid.start).plan
    # both bands in the same stretches
    return replace(rows, plan=full_rate(plan), grid=range(source.n), samples=STRETCH)


def _near(every: RecordRows, wider: RecordRows, key: str, inside: range) -> Near:
    """Return where a measured speed is near zero, from rows that keep every sample."""
    total = 0.0
    for (start, one), (_, other) in zip(_speeds(every, key), _speeds(wider, key), strict=True):
        change = (other - one)[1:-1]
        total += float(np.sum(change[max(inside[0] - start, 0) : max(inside[-1] + 1 - start, 0)] ** 2))
    error = sqrt(total / len(inside))
    parts = [_within(speed, error, start - 1) for start, speed in _speeds(every, key)]
    return np.concatenate([near for near, _ in parts]), np.concatenate([certain for _, certain in parts])


def _speeds(every: RecordRows, key: str) -> Iterator[tuple[int, FloatArray]]:
    """Yield a measured speed in stretches, SI, a sample more at both ends, and where each starts."""

    def of(chunk: Chunk) -> tuple[int, FloatArray]:
        return chunk.start, chunk.direction(key, chunk.start - 1, chunk.stop + 1)

    return every.over_chunks(of)


def _given_speeds(every: RecordRows) -> dict[str, FloatArray]:
    """Return speeds that rows give at all samples, by their names, SI, (n,) each."""
    parts = list(
        every.over_chunks(lambda chunk: chunk.plan.given_speeds(chunk, chunk.start, chunk.stop - chunk.start))
    )
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _low_passed(every: RecordRows, speed: FloatArray) -> FloatArray:
    """Return a speed behind the low-pass for directions, continued by a sample at both ends, (n + 2,)."""
    operator = fused_operator(every.plan.filtering.directions, every.source.fs, fast=every.plan.fast)
    return np.pad(operator.apply(speed, 0, len(speed))[:, 0], 1, mode="edge")


def _error(change: FloatArray, inside: range, around: int) -> FloatArray:
    """Return what a speed is off by, shape (n,), from what a wider band changes of it, shape (n + 2,).

    It is the root of the mean square of all samples `inside`, or of those `around` a sample where that is
    more: where a motor sticks a low-pass goes on, and bends the speed before and behind the rest.
    """
    square = change[1:-1] ** 2
    width = 2 * around + 1
    sums = np.cumsum(np.pad(square, (around + 1, around), mode="edge"))
    local = np.maximum(sums[width:] - sums[:-width], 0.0) / width
    return np.asarray(np.sqrt(np.maximum(local, np.mean(square[inside.start : inside.stop]))))


def _within(speed: FloatArray, error: FloatArray | float, start: int) -> Near:
    """Return the inner samples, from `start` + 1 on, at which a speed, shape (n + 2,), is near zero."""
    step = 0.5 * np.abs(speed[2:] - speed[:-2])
    scale = np.maximum(error, step / CLEARLY_MOVING)
    size = np.abs(speed[1:-1])
    near = np.flatnonzero(size < CLEARLY_MOVING * scale)
    return near.astype(np.int64) + start + 1, size[near] / scale[near]
