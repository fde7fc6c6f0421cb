"""Samples at which rows do not tell the direction of a motor that no sensor sees: forces there are left open.

Near a reversal the speed that rows give has the wrong sign where noise, or the low-pass in front of the sign,
moves its crossing over a sample. Along periodic motion the same samples are wrong again and again, and
friction, and through it springs and inertias, come out wrong by what intervals hardly hold. What the force at
such a sample is off by goes through the low-pass as a pulse; rows without their parts along these pulses do
not depend on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import RecordRows, full_rate, unmasked_rows
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.thresholds import (
    CLEARLY_MOVING,
    HIGHEST_WIDER,
    MOST_PULSES,
    MOST_UNCERTAIN,
    PULSE_ALIKE,
    TURN_TOLERANCE,
    WIDER_BAND,
)


def without_uncertain_turns(
    observation: Observation, model: Model, records: Sequence[Record], choice: FilterChoice, drop: int
) -> Observation:
    """Return rows that do not depend on directions which given speeds do not tell.

    Of rows about an estimate, with the directions of samples; others stay, and so do those that are made
    again whenever they are asked for: over long records wrong directions average out.

    Parameters
    ----------
    observation : Observation
        Of the records.
    model : Model
    records : sequence of Record
    choice : FilterChoice
    drop : int
        As for `observe`.
    """
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel) or not leaves_turns_open(model):
        return observation
    holding = _held_directions(model, kernel)
    found = list(observation.blocks)
    for index, record in enumerate(records):
        own = [k for k, one in enumerate(found) if one.record == index and one.in_memory and one.count]
        if not any(holding[found[k].row] for k in own):
            continue
        factor = choice.decimation[index]
        rows = unmasked_rows(model, record, choice, factor, drop)
        uncertain = _uncertainty(rows, choice)
        reach = support_samples(choice.filter_order, choice.cutoff_hz, record.fs, 0, TURN_TOLERANCE)
        pulse = _pulse(rows, reach)
        for k in own:
            lines = [uncertain[name] for name in holding[found[k].row]]
            found[k] = _without_pulses(found[k], factor, lines, pulse)
    return replace(observation, blocks=tuple(found))


def leaves_turns_open(model: Model) -> bool:
    """Tell whether rows of a model hold directions of given speeds, at samples: about an estimate."""
    kernel = model.kernel
    return isinstance(kernel, DeflectedKernel) and kernel.sampled and bool(kernel.speeds)


def _held_directions(model: Model, kernel: DeflectedKernel) -> list[tuple[str, ...]]:
    """Return the names of the given speeds whose directions each row holds."""
    names = [one.name for one in kernel.speeds]
    found = []
    for columns in model.regressor_columns:
        keys = {key for terms in columns.values() for _, key in terms}
        held = {term for key in keys for _, term in kernel.sums.get(key, ())}
        ways = ("sign", "forward", "backward")
        found.append(tuple(n for n in names if held.intersection(f"{way} {n}" for way in ways)))
    return found


def _uncertainty(rows: RecordRows, choice: FilterChoice) -> dict[str, FloatArray]:
    """Return by how many of its errors each given speed is off zero, at all samples, by its name, (n,) each.

    Its error is what a wider band changes: noise, several times as much of it, and what the low-pass takes.
    """
    every = replace(rows, plan=full_rate(rows.plan), grid=range(rows.source.n))
    parts = list(
        every.over_chunks(lambda chunk: chunk.plan.given_speeds(chunk, chunk.start, chunk.stop - chunk.start))
    )
    fs, own_hz = rows.source.fs, choice.direction_cutoff_hz
    wide_hz = min(WIDER_BAND * own_hz, HIGHEST_WIDER * fs)
    own, wide = (butterworth(choice.filter_order, hz, fs) for hz in (own_hz, wide_hz))
    found = {}
    for name in parts[0]:
        speed = np.concatenate([part[name] for part in parts])
        narrow, wider = (
            fused_operator(sections, fs, fast=rows.plan.fast).apply(speed, 0, len(speed))[:, 0]
            for sections in (own, wide)
        )
        inside = slice(rows.grid[0], rows.grid[-1] + 1)
        error = sqrt(float(np.mean((wider - narrow)[inside] ** 2)))
        found[name] = np.abs(narrow) / error if error else np.full(len(speed), np.inf)
    return found


def _pulse(rows: RecordRows, reach: int) -> FloatArray:
    """Return what the low-pass of the rows makes of one sample of 1, from `reach` samples before it on."""
    filtering = rows.plan.filtering
    operator: FusedOperator = fused_operator(filtering.low_pass, filtering.fs, fast=rows.plan.fast)
    one = np.zeros(2 * reach + 1)
    one[reach] = 1.0
    return operator.apply(one, 0, len(one))[:, 0]


def _without_pulses(block: RowBlock, factor: int, lines: Sequence[FloatArray], pulse: FloatArray) -> RowBlock:
    """Return a block without its parts along the pulses of uncertain samples.

    `lines` are the directions' certainties at all samples, shape (n,) each.
    """
    if not lines:
        return block
    times, reach = block.start + factor * block.place, len(pulse) // 2
    certain = np.min(lines, axis=0)
    near = np.flatnonzero(certain < CLEARLY_MOVING)
    near = near[(near >= times[0] - reach) & (near <= times[-1] + reach)]
    most = int(MOST_UNCERTAIN * block.count)
    if len(near) > most:
        near = np.sort(near[np.argsort(certain[near], kind="stable")[:most]])
    if not near.size:
        return block
    Y, W = block.Y.copy(), block.W.copy()
    for group in _groups(near, 2 * reach):
        felt = slice(*np.searchsorted(times, (group[0] - reach, group[-1] + reach + 1)).tolist())
        apart = times[felt, None] - group + reach
        inside = (apart >= 0) & (apart < len(pulse))
        along, sizes, _ = np.linalg.svd(
            np.where(inside, pulse[np.clip(apart, 0, len(pulse) - 1)], 0.0), full_matrices=False
        )
        along = along[:, sizes > PULSE_ALIKE * sizes[0]] if sizes.size and sizes[0] else along[:, :0]
        Y[felt] -= along @ (along.T @ Y[felt])
        W[felt] -= along @ (along.T @ W[felt])
    return replace(block, Y=Y, W=W)


def _groups(places: IntArray, apart: int) -> Iterator[IntArray]:
    """Yield places in groups that are farther than `apart` from each other, or of the largest size."""
    for group in np.split(places, np.flatnonzero(np.diff(places) > apart) + 1):
        for start in range(0, len(group), MOST_PULSES):
            yield group[start : start + MOST_PULSES]
