"""What a force does between its samples where it bends: neither its record nor a residual shows it.

The spectrum of a force whose slope jumps falls with 1 / f^2, and what lies beyond half the sampling frequency
is folded. A signal that is straight between samples, as a commanded force is that bends at samples, has
1 / sinc(f / fs)^2 times its own spectrum in them, (pi f / fs)^2 / 3 more: at every bend an impulse of minus a
twelfth of what its slope, a sample, grows by. The motion has no such share. What the force has too much looks
like inertia, the same in every record of one motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.jumps import bends
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def folded_forces(model: Model) -> tuple[Effect, ...]:
    """Return what is folded into each force of a model, of the size 1 where it bends at its samples."""
    remedy = "sample it faster, or all channels behind one low-pass"
    return tuple(
        Effect(f"fold of {key}", "fold", words, words, remedy, partial(_folded, channel=key), key)
        for key, words in ((one.key, f"{one.key} bends between samples") for one in model.actuators)
    )


def forces_bend(model: Model, records: Iterable[Record]) -> bool:
    """Tell whether a force bends between samples in any of some records."""
    return any(_bends(record, one.key)[0].size for record in records for one in model.actuators)


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
