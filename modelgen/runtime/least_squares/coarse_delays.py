"""A first look at how late forces are, in whole samples, for delays that small steps would not find.

The columns W hold no force: with Y alone shifted, the rows are solved again for every delay at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.spanned import Spanned
from modelgen.runtime.least_squares.thresholds import COARSE_BETTER, EARLIEST, LATEST, LOOKED_AT
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows, full_rate, unmasked_rows


def coarse_delays(
    fit: Fit,
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    channels: Sequence[str],
) -> dict[str, float]:
    """Return the delay in s of each force to start from: 0, unless another leaves clearly less.

    Parameters
    ----------
    fit : Fit
        Least squares of the records.
    channels : sequence of str
        Forces; one at a time is shifted.
    """
    sample = 1.0 / min(record.fs for record in records)
    found = dict.fromkeys(channels, 0.0)
    R = fit.regressors
    R = replace(R, samples=tuple(_first(fit, R.samples))).weighted(fit.weights)
    spanned = Spanned(R)
    parts = [w * y for w, y in zip(fit.weights, _first(fit, [block.Y for block in fit.blocks]), strict=True)]
    rest = spanned.apart(np.concatenate(parts))
    rests = spanned.parts(rest)
    steps = np.arange(EARLIEST, LATEST + 1, dtype=float)
    for channel in channels:
        # a force is in few rows: the others stay as they are
        changes, across = np.zeros(len(steps)), np.zeros((spanned.width, len(steps)))
        for index, change in _shifted(fit, model, records, choice, channel, np.asarray(steps * sample)):
            across += spanned.across(index, change)
            changes += np.sum(change * (change + 2.0 * rests[index][:, None]), axis=0)
        inner = spanned.coordinates(across)
        left = np.sqrt(np.maximum(rest @ rest + changes - np.sum(inner**2, axis=0), 0.0))
        best = int(np.argmin(left))
        if left[best] < COARSE_BETTER * left[-EARLIEST]:
            found[channel] = float(steps[best] * sample)
    return found


def _first(fit: Fit, parts: Sequence[FloatArray]) -> list[FloatArray]:
    return [part[_chosen(len(block.place))] for block, part in zip(fit.blocks, parts, strict=True)]


def _chosen(n: int) -> slice:
    """Return the samples looked at of n: those in the middle, where there are many."""
    start = max(0, (n - LOOKED_AT) // 2)
    return slice(start, start + LOOKED_AT)


def _shifted(
    fit: Fit,
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    channel: str,
    delays_s: FloatArray,
) -> Iterator[tuple[int, FloatArray]]:
    """Yield by how much the weighted Y changes when a force is earlier: block, array (n, delays)."""
    orders = {signal.key: signal.derivative for signal in model.signals if signal.actuator == channel}
    place = {key: index for index, key in enumerate(orders)}
    for index, (block, weight) in enumerate(zip(fit.blocks, fit.weights, strict=True)):
        shares = np.zeros(len(orders))
        for share, key in model.measurement_columns[block.row]:
            if key in orders:
                shares[place[key]] += share
        chosen = block.place[_chosen(len(block.place))]
        if not np.any(shares) or not len(chosen):
            continue
        record, factor = records[block.record], choice.decimation[block.record]
        at = block.start + factor * chosen
        # all samples around those looked at, at the full rate
        first, last = (
            int(at[0]) + round(delays_s[0] * record.fs),
            int(at[-1]) + round(delays_s[-1] * record.fs),
        )
        low, high = max(first, 0), min(last + 1, record.n)
        rows = unmasked_rows(model, record, choice, factor)
        every = RecordRows(rows.source, full_rate(rows.plan), range(low, high))
        force = weight * (every.derivatives(channel, list(orders.values())) @ shares)
        shifts = np.round(delays_s * record.fs).astype(np.int64)
        there = np.clip(at[:, None] + shifts - low, 0, len(force) - 1)
        yield index, force[there] - force[np.clip(at - low, 0, len(force) - 1)][:, None]
