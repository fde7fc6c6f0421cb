"""Records as they are given, and channels that a model makes of theirs: sums, as of two joints' motors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.model.model import Model, Terms
from modelgen.runtime.records.channels import Channels, ChannelSignals
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class SummedChannels:
    """A record in stretches, in SI, some of whose channels are sums of others."""

    source: Channels
    sums: Mapping[str, Terms]

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(dict.fromkeys((*self.source.keys, *self.sums)))

    @property
    def name(self) -> str:
        """Names the record in messages."""
        return self.source.name

    @property
    def fs(self) -> float:
        """Sampling frequency in Hz."""
        return self.source.fs

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.source.n

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,)."""
        if channel not in self.sums:
            return self.source.read(channel, start, stop)
        return sum(
            (weight * self.source.read(key, start, stop) for weight, key in self.sums[channel]),
            np.zeros(stop - start),
        )


def as_records(records: Record | Channels | Sequence[Record | Channels]) -> tuple[Record, ...]:
    """Return records as a tuple; what is no record, but can be read in stretches, becomes one.

    Raises
    ------
    DataError
        When there is none, or something is neither.
    """
    given: Any = records
    single = isinstance(given, Record) or _is_channels(given) or not isinstance(given, Iterable)
    several = (given,) if single else tuple(given)
    if not several:
        raise DataError.at("records", "there are none", "give at least one Record")
    strange = [one for one in several if not isinstance(one, Record) and not _is_channels(one)]
    if strange:
        remedy = "give Records; modelgen.read_record makes one of a file"
        problems = [Problem("records", f"hold a {type(one).__name__}", remedy) for one in strange]
        raise DataError(*problems)
    return tuple(one if isinstance(one, Record) else Record.over(one) for one in several)


def _is_channels(one: object) -> bool:
    """Tell whether something can be read as `Channels` can; a mapping of signals, say, cannot."""
    return all(hasattr(one, name) for name in ("keys", "name", "fs", "n", "read"))


def with_derived(model: Model, records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records with the channels that a model makes of theirs, where they have all of these."""
    return tuple(_extended(model, record) for record in records)


def _extended(model: Model, record: Record) -> Record:
    keys = frozenset(record.keys)
    sums = {name: terms for name, terms in model.derived.items() if all(key in keys for _, key in terms)}
    sums |= {name: () for name in model.loads if name not in keys}  # nothing is carried where nothing is said
    if not sums:
        return record
    summed = SummedChannels(record.source, sums)
    if isinstance(record.signals, ChannelSignals):
        return Record.over(summed, record.tag)
    return record.edited({key: summed.read(key, 0, record.n) for key in sums})
