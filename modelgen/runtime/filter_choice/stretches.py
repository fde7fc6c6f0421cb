"""Stretches of a long record, in memory: what filters are chosen from, and what tells rest from motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.errors import DataError
from modelgen.magnitudes import LARGEST
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filters.block_numpy import largest
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Channels, not_finite
from modelgen.runtime.records.record import Record

# A record of so many samples is looked at as a whole; of a longer one, stretches that are spread evenly.
WHOLE = 1 << 18
PIECES = 4


def stretches(model: Model, source: Channels) -> tuple[Record, ...]:
    """Return a record in memory, or pieces of it, each named by where it begins.

    Raises
    ------
    DataError
        When a channel is missing, or a sample is not finite.
    """
    if source.n <= WHOLE:
        return (_piece(model, source, 0, source.n, source.name),)
    length = WHOLE // PIECES
    starts = [round(k * (source.n - length) / (PIECES - 1)) for k in range(PIECES)]
    return tuple(
        _piece(model, source, start, start + length, f"{source.name} from sample {start}") for start in starts
    )


def choose_from_stretches(
    model: Model,
    pieces: Sequence[Sequence[Record]],
    cutoff_hz: float | None = None,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
) -> FilterChoice:
    """Choose filters as `choose_filter` does, from the stretches of each record.

    Raises
    ------
    DataError
        When an option is out of its range, or nothing moves and no cut-off is given.
    """
    choice = choose_filter(
        model,
        [piece for record in pieces for piece in record],
        cutoff_hz=cutoff_hz,
        filter_order=filter_order,
        decimation=decimation,
        direction_cutoff_hz=direction_cutoff_hz,
    )
    firsts = [sum(len(record) for record in pieces[:index]) for index in range(len(pieces))]
    return replace(choice, decimation=tuple(choice.decimation[first] for first in firsts))


def _piece(model: Model, source: Channels, start: int, stop: int, name: str) -> Record:
    signals = {}
    for key in model.channels:
        try:
            signals[key] = np.asarray(source.read(key, start, stop), dtype=float)
        except KeyError as error:
            remedy = f"give it; the model needs {', '.join(model.channels)}"
            raise DataError.at(source.name, f"has no channel {key}", remedy) from error
    for key, samples in signals.items():
        if not largest(samples) <= LARGEST:
            raise not_finite(source, key, start, stop)
    return Record(signals, source.fs, name)
