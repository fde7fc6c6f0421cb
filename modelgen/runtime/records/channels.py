"""Channels: a record that is read in stretches, from memory or from a file that is never loaded whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.magnitudes import LARGEST
from modelgen.runtime.records.record import Record

FloatArray = npt.NDArray[np.float64]


class Channels(Protocol):
    """What a record in stretches offers; `n` samples at `fs` in Hz of every channel.

    Several threads may read at a time.
    """

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
        """Return samples start to stop, within the record, of a channel in SI."""


@dataclass(frozen=True, eq=False)
class RecordChannels:
    """A record in memory, read in stretches."""

    record: Record

    @property
    def name(self) -> str:
        """Name of the record."""
        return self.record.name

    @property
    def fs(self) -> float:
        """Sampling frequency in Hz."""
        return self.record.fs

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.record.n

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, without a copy."""
        return self.record.signals[channel][start:stop]


def read_continued(source: Channels, channel: str, start: int, stop: int) -> FloatArray:
    """Return samples start to stop of a channel, continued beyond the record by its odd mirror image."""
    low, high = max(start, 0), min(stop, source.n)
    samples = np.asarray(source.read(channel, low, high), dtype=float)
    if low == start and high == stop:
        return samples
    with np.errstate(invalid="ignore"):  # who uses it asks whether it is finite
        return np.pad(samples, (low - start, stop - high), mode="reflect", reflect_type="odd")


def not_finite(source: Channels, channel: str, start: int, stop: int) -> DataError:
    """Return the error that names the first sample that is not finite, or beyond what can be calculated."""
    low = max(start, 0)
    samples = np.asarray(source.read(channel, low, min(stop, source.n)), dtype=float)
    bad = int(np.flatnonzero(~(np.abs(samples) <= LARGEST))[0])
    remedy = "cut the record there, or interpolate the missing samples"
    return DataError.at(f"{source.name}: channel {channel}, sample {low + bad}", f"is {samples[bad]}", remedy)
