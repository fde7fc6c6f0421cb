"""What a force does between its samples where it bends, or steps: neither its record nor a residual shows it.

The spectrum of a force whose slope jumps falls with 1 / f^2, and what lies beyond half the sampling frequency
is folded. A signal that is straight between samples, as a commanded force is that bends at samples, has
1 / sinc(f / fs)^2 times its own spectrum in them, (pi f / fs)^2 / 3 more: at every bend an impulse of minus a
twelfth of what its slope, a sample, grows by. The motion has no such share. What the force has too much looks
like inertia, the same in every record of one motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from math import comb

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.jumps import bends
from modelgen.runtime.identification.thresholds import LAGS_OF_STEPS, STEPS_TAKEN
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record

SMOOTH_LAGS = np.array([comb(8, k) for k in range(9)]) / 2.0**8


def folded_forces(model: Model) -> tuple[Effect, ...]:
    """Return what is folded into each force of a model, of the size 1 where it bends at its samples.

    And what it moves that its steps are half a sample later, beside what is no step.
    """
    remedy = "sample it faster, or all channels behind one low-pass"
    return tuple(
        Effect(f"{name} of {key}", "fold", words, words, remedy, partial(changes, channel=key), key)
        for key in (one.key for one in model.actuators)
        for name, words, changes in (
            ("fold", f"{key} bends between samples", _folded),
            ("instants", f"{key} takes its steps between samples", _later_steps),
        )
    )


def forces_bend(model: Model, records: Iterable[Record]) -> bool:
    """Tell whether a force bends between samples in any of some records."""
    return any(_bends(record, one.key)[0].size for record in records for one in model.actuators)


def _later_steps(simulated: Simulated, channel: str) -> Changes:
    """Return what steps of the measured force that come half a sample later add, beside what is no step.

    A controller that is faster than the record, or an analogue one, answers a step at once; where all of a
    command is held, its answer is late by half a sample. What it feeds back is nearly a sum of the columns.
    """
    record = simulated.measured
    if record is None or channel not in record.signals:
        return {}
    places, sizes = record.facts.read_steps(channel)
    if len(places) < STEPS_TAKEN * record.n:
        return {}
    return {channel: -0.5 * _moved_to(record.signals[channel], places, sizes)}


def _moved_to(samples: FloatArray, places: IntArray, sizes: FloatArray) -> FloatArray:
    """Return impulses of so many sizes where a signal steps that was shifted, or held, since it was read."""
    change = np.pad(np.diff(samples, prepend=samples[:1]), LAGS_OF_STEPS + 1)
    lags = np.arange(-LAGS_OF_STEPS, LAGS_OF_STEPS + 1)
    alike = np.array([float(sizes @ change[places + LAGS_OF_STEPS + 1 + lag]) for lag in lags])
    alike = np.convolve(alike, SMOOTH_LAGS, "same")  # edits keep only what changes slowly
    best = int(np.clip(np.argmax(alike), 1, len(lags) - 2))
    before, at, behind = alike[best - 1 : best + 2].tolist()
    curved = before - 2.0 * at + behind
    lag = float(lags[best]) + (0.5 * (before - behind) / curved if curved < 0.0 else 0.0)
    whole = int(np.floor(lag))
    found = np.zeros(len(samples))
    for step, share in ((whole, 1.0 - lag + whole), (whole + 1, lag - whole)):
        inside = (places + step >= 0) & (places + step < len(found))
        np.add.at(found, places[inside] + step, share * sizes[inside])
    return found


def _bends(record: Record, channel: str) -> tuple[IntArray, FloatArray]:
    """Return where a force bends, and by how much, as `bends` does; nowhere in a record without it."""
    if channel not in record.signals:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    return record.facts.kept(("bends", channel), lambda: bends(record.signals[channel]))


def _folded(simulated: Simulated, channel: str) -> Changes:
    """Return what is folded where the measured force bends; nothing for a record in which it does not."""
    record = simulated.measured
    if record is None:
        return {}
    places, growth = _bends(record, channel)
    if not places.size:
        return {}
    folded = np.zeros(record.n)
    folded[places] = -growth / 12.0
    return {channel: folded}
