"""Channels: what is recorded, read in stretches; from memory, or from a file that is never loaded whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import LARGEST
from modelgen.runtime.records.channel_checks import MISSING_REMEDY

# Samples read at a time where a whole channel is looked through.
READ_SAMPLES = 1 << 18


class Channels(Protocol):
    """What a record in stretches offers; `n` samples at `fs` in Hz of every channel.

    Several threads may read at a time. A `Record` is one, too.
    """

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""

    @property
    def name(self) -> str:
        """Names the record in messages."""

    @property
    def fs(self) -> float:
        """Sampling frequency in Hz."""

    @property
    def n(self) -> int:
        """Number of samples."""

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop, within the record, of a channel in SI, shape (stop - start,)."""


class ChannelSignals(Mapping[str, FloatArray]):
    """Channels as a mapping of key to samples, shape (n,); each is read and checked whenever asked for."""

    def __init__(self, source: Channels) -> None:
        self.source = source

    def __getitem__(self, key: str) -> FloatArray:
        if key not in self.source.keys:
            raise KeyError(key)
        samples = np.asarray(self.source.read(key, 0, self.source.n), dtype=float)
        if not np.all(np.abs(samples) <= LARGEST):
            raise not_finite(self.source, key, 0, self.source.n)
        return samples

    def __contains__(self, key: object) -> bool:
        return key in self.source.keys

    def __iter__(self) -> Iterator[str]:
        return iter(self.source.keys)

    def __len__(self) -> int:
        return len(self.source.keys)


@dataclass(frozen=True)
class Edit:
    """How a channel is made of another one.

    `make` takes samples start - margin to stop + margin of `channel`, its first and last reading repeated
    beyond the ends of the record, and start to samples start to stop of the new channel.
    """

    channel: str
    make: Callable[[FloatArray, int], FloatArray]
    margin: int = 0

    def whole(self, samples: FloatArray) -> FloatArray:
        """Return the new channel from the whole of the other one, in their units, shape (n,) each."""
        return np.asarray(self.make(np.pad(samples, self.margin, mode="edge"), 0))


@dataclass(frozen=True, eq=False)
class EditedChannels:
    """Part of a record from sample `start`, some of whose channels are made of others.

    `edits` maps these to how they are made, or to their samples, in SI, shape (n of the source,).
    """

    source: Channels
    name: str
    n: int
    edits: Mapping[str, Edit | FloatArray] = field(default_factory=dict)
    start: int = 0

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(dict.fromkeys((*self.source.keys, *self.edits)))

    @property
    def fs(self) -> float:
        """Sampling frequency in Hz."""
        return self.source.fs

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,)."""
        edit = self.edits.get(channel)
        first, behind = self.start + start, self.start + stop
        if edit is None:
            return self.source.read(channel, first, behind)
        if isinstance(edit, np.ndarray):
            return edit[first:behind]
        low, high = first - edit.margin, behind + edit.margin
        inside = max(low, 0), min(high, self.source.n)
        samples = np.asarray(self.source.read(edit.channel, *inside), dtype=float)
        return edit.make(np.pad(samples, (inside[0] - low, high - inside[1]), mode="edge"), first)


def read_continued(source: Channels, channel: str, start: int, stop: int) -> FloatArray:
    """Return samples start to stop, shape (stop - start,), continued beyond the ends by odd mirror images."""
    low, high = max(start, 0), min(stop, source.n)
    samples = np.asarray(source.read(channel, low, high), dtype=float)
    before, behind = low - start, stop - high
    if not before and not behind:
        return samples
    with np.errstate(invalid="ignore"):  # who uses it asks whether it is finite
        if max(before, behind) >= len(samples):  # several images
            return np.pad(samples, (before, behind), mode="reflect", reflect_type="odd")
        continued = np.empty(stop - start)
        continued[before : before + len(samples)] = samples
        np.subtract(2.0 * samples[0], samples[before:0:-1], out=continued[:before])
        last = continued[before + len(samples) :]
        np.subtract(2.0 * samples[-1], samples[-2 : -2 - behind : -1], out=last)
        return continued


def in_stretches(source: Channels, channel: str, length: int | None = None) -> Iterator[FloatArray]:
    """Yield the samples of a channel, shape (n,) each: stretches of so many samples (by default 2^18).

    Raises
    ------
    DataError
        When a sample is not finite, or beyond what can be calculated.
    """
    return (samples for samples, _, _ in with_extremes(source, channel, length))


def with_extremes(
    source: Channels, channel: str, length: int | None = None
) -> Iterator[tuple[FloatArray, float, float]]:
    """Yield the same, in its unit, shape (n,) each, with its least and its greatest sample."""
    step = length or READ_SAMPLES
    for start in range(0, source.n, step):
        stop = min(start + step, source.n)
        samples = np.asarray(source.read(channel, start, stop), dtype=float)
        least, greatest = float(samples.min()), float(samples.max())
        # a sum of squares would overflow where the largest of them does not
        if not max(greatest, -least) <= LARGEST:
            raise not_finite(source, channel, start, stop)
        yield samples, least, greatest


def not_finite(source: Channels, channel: str, start: int, stop: int) -> DataError:
    """Return the error that names the first sample that is not finite, or beyond what can be calculated."""
    low = max(start, 0)
    samples = np.asarray(source.read(channel, low, min(stop, source.n)), dtype=float)
    bad = int(np.flatnonzero(~(np.abs(samples) <= LARGEST))[0])
    where = f"{source.name}: channel {channel}, sample {low + bad}"
    return DataError.at(where, f"is {samples[bad]}", MISSING_REMEDY)
