"""RecordFacts: what many ask of one record, computed once and then kept with it.

Spectra of a long record are the means of those of some stretches, spread evenly over where the record is
active: an experiment may take a minute of a log of an hour. What a single sample can decide (extremes, the
mean) is asked of all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.jumps import jumps, steps
from modelgen.runtime.filters.noise_spectrum import ReadingSpectrum, mean_spectrum, reading_spectrum
from modelgen.runtime.filters.power_spectrum import power_spectrum
from modelgen.runtime.filters.rounding import rounding
from modelgen.runtime.filters.thresholds import JUMP_ORDER
from modelgen.runtime.numerics.recent_arrays import RecentArrays
from modelgen.runtime.numerics.threads import each
from modelgen.runtime.records.channels import Channels, with_extremes
from modelgen.runtime.records.period import first_lag
from modelgen.runtime.records.thresholds import ACTIVE, FILTERED_BYTES, LITTLE_CHANGED, PIECES, WHOLE

ComplexArray = npt.NDArray[np.complex128]
Made = TypeVar("Made")


@dataclass(frozen=True)
class Extent:
    """Least and greatest reading of a channel, and their mean, over the whole record; in its unit."""

    least: float
    greatest: float
    mean: float

    @property
    def peak(self) -> float:
        """Largest magnitude."""
        return max(-self.least, self.greatest)

    @property
    def span(self) -> float:
        """Greatest minus least reading."""
        return self.greatest - self.least


@dataclass(frozen=True, eq=False)
class ChannelFacts:
    """What is known of one channel: what filters made of it, and whatever else was worked out, by its key.

    Records that hold the same samples of the channel share it.
    """

    filtered: RecentArrays
    known: dict[Hashable, Any] = field(default_factory=dict)

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """Return what was made under a key, made when first asked for."""
        if key not in self.known:
            self.known[key] = make()
        return cast(Made, self.known[key])


class RecordFacts:
    """The spectra, extents and periods of a record's channels, in SI. Reached as `Record.facts`.

    `channels` holds those of each channel; `same` are those of another record, of the channels that are the
    same. `before` are the facts of the record that this one was made of: those of what was read are kept.
    """

    def __init__(
        self,
        source: Channels,
        same: Mapping[str, ChannelFacts] | None = None,
        before: RecordFacts | None = None,
    ) -> None:
        self._source = source
        self._read: RecordFacts | None = before and (before._read or before)
        shared = same or {}
        self.channels = {
            key: shared[key] if key in shared else ChannelFacts(RecentArrays(FILTERED_BYTES * source.n))
            for key in source.keys
        }
        self._kept: dict[Hashable, Any] = {}

    def kept(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """Return what was made of the record under a key, made when first asked for."""
        if key not in self._kept:
            self._kept[key] = make()
        return cast(Made, self._kept[key])

    def rounding(self, channel: str) -> float:
        """Return the step to which readings of a channel were rounded, in its unit; 0 if they were not.

        Where a channel was set right by little since it was read, that of the reading.
        """
        return self._once(channel, "rounding", lambda: self._rounding(channel))

    def _rounding(self, channel: str) -> float:
        samples, before = np.concatenate(self.stretches(channel)), self._read
        if before is not None and channel in before._source.keys:
            read = np.concatenate(before.stretches(channel))
            if len(read) == len(samples) and np.std(samples - read) < LITTLE_CHANGED * np.std(read):
                return before.rounding(channel)
        return rounding(samples)

    def forget_filtered(self) -> None:
        """Let go what filters made of the channels."""
        for channel in self.channels.values():
            channel.filtered.clear()

    def stretches(self, channel: str) -> tuple[FloatArray, ...]:
        """Return the samples of a channel, or of a long record stretches of equal length, shape (m,) each."""
        source = self._source
        return self._once(
            channel,
            "stretches",
            lambda: tuple(
                np.asarray(source.read(channel, part.start, part.stop), dtype=float) for part in self.parts
            ),
        )

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """What is looked at for spectra: all of the record, or stretches of equal length where it is active.

        A stretch counts by the steps from sample to sample (rms), each channel relative to where they are
        largest.
        """
        n = self._source.n
        if n <= WHOLE:
            return (slice(0, n),)
        steps = [self._walked(channel)[1] for channel in self._source.keys]
        activity = np.sum([one / one.max() for one in steps if one.max() > 0.0], axis=0)
        active = np.flatnonzero(activity >= ACTIVE * np.max(activity)) if np.ndim(activity) else [0]
        places = np.linspace(0, len(active) - 1, PIECES).round().astype(int)
        length = WHOLE // PIECES
        starts = [min(int(active[place]) * length, n - length) for place in dict.fromkeys(places.tolist())]
        return tuple(slice(start, start + length) for start in starts)

    def lines(self, channel: str, number: int) -> ComplexArray:
        """Return the Fourier transform of a stretch, less the line nearest to it, shape (m // 2 + 1,).

        Under a Hann window, and nearest under that: what vibrates at the ends would tilt it, and a slope
        leaks into all lines.
        """

        def make() -> ComplexArray:
            part = self.stretches(channel)[number]
            window, t = np.hanning(len(part)), np.linspace(-1.0, 1.0, len(part))
            line = np.linalg.qr(np.column_stack([window, window * t]))[0]
            level = part * window
            return np.asarray(np.fft.rfft(level - line @ (line.T @ level)))

        return self.kept(("lines", channel, number), make)

    def extent(self, channel: str) -> Extent:
        """Return the extent of a channel.

        Raises
        ------
        DataError
            When a sample is not finite.
        """
        return self._walked(channel)[0]

    def _walked(self, channel: str) -> tuple[Extent, FloatArray]:
        """Return the extent of a channel, and the rms of its steps in every stretch, shape (stretches,)."""

        def make() -> tuple[Extent, FloatArray]:
            found = [
                (least, greatest, float(part.sum()), _rms_step(part))
                for part, least, greatest in with_extremes(self._source, channel, WHOLE // PIECES)
            ]
            least, greatest, sums, steps = zip(*found, strict=True)
            return Extent(min(least), max(greatest), sum(sums) / self._source.n), np.array(steps)

        return self.channels[channel].once("walked", make)

    def lag(self, channel: str) -> int | None:
        """Return after how many samples a channel repeats itself; None where it does not."""
        return self.channels[channel].once(
            "lag", lambda: first_lag(self._source, channel, self.extent(channel).mean)
        )

    def spectrum(self, channel: str) -> ReadingSpectrum:
        """Return the density of a reading and of its own noise, see `reading_spectrum`."""
        fs = self._source.fs
        return self._once(
            channel,
            "spectrum",
            lambda: mean_spectrum(self._of_stretches(channel, lambda part: reading_spectrum(part, fs))),
        )

    def jumps(self, channel: str) -> IntArray:
        """Return the samples at which a channel jumps, shape (jumps,), see `jumps`."""
        return self.channels[channel].once("jumps", lambda: np.concatenate(list(self._jumps(channel))))

    def _jumps(self, channel: str) -> Iterator[IntArray]:
        n = self._source.n
        for start in range(0, n, WHOLE):
            low, high = max(start - JUMP_ORDER, 0), min(start + WHOLE + JUMP_ORDER, n)
            found = low + jumps(self._source.read(channel, low, high))
            yield found[(found >= start) & (found < start + WHOLE)]

    def steps(self, channel: str) -> tuple[IntArray, FloatArray]:
        """Return the samples at which a channel takes a step, and its size, shape (steps,), see `steps`.

        Other channels as they were read tell what it follows.
        """

        def make() -> tuple[IntArray, FloatArray]:
            places, sizes = zip(*self._steps(channel), strict=True)
            return np.concatenate(places), np.concatenate(sizes)

        return self.channels[channel].once("steps", make)

    def _steps(self, channel: str) -> Iterator[tuple[IntArray, FloatArray]]:
        n, read = self._source.n, (self._read or self)._source
        keys = [key for key in read.keys if key != channel]

        def part(start: int) -> tuple[IntArray, FloatArray]:
            low, high = max(start - JUMP_ORDER, 0), min(start + WHOLE + JUMP_ORDER, n)
            others = [read.read(key, low, high) for key in keys]
            places, sizes = steps(self._source.read(channel, low, high), others)
            inside = (low + places >= start) & (low + places < start + WHOLE)
            return low + places[inside], sizes[inside]

        starts = range(0, n, WHOLE)
        return each(part, starts, len(starts))

    def power(
        self, channel: str, derivative: int = 0, keep_mean: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return frequencies in Hz and power of a derivative, shape (lines,) each, see `power_spectrum`."""

        def make() -> tuple[FloatArray, FloatArray]:
            fs = self._source.fs
            found = self._of_stretches(channel, lambda part: power_spectrum(part, fs, derivative, keep_mean))
            return found[0][0], np.mean([power for _, power in found], axis=0)

        return self._once(channel, ("power", derivative, keep_mean), make)

    def _of_stretches(self, channel: str, work: Callable[[FloatArray], Made]) -> list[Made]:
        """Return what a function makes of the stretches of a channel; several threads take one each."""
        stretches = self.stretches(channel)
        return list(each(work, stretches, len(stretches)))

    def _once(self, channel: str, key: Hashable, make: Callable[[], Made]) -> Made:
        """Return what was made of the parts of a channel that are looked at; others may share the channel."""
        return self.channels[channel].once((key, *(part.start for part in self.parts)), make)


def _rms_step(samples: FloatArray) -> float:
    """Return the rms of the steps from sample to sample."""
    if len(samples) < 2:
        return 0.0
    steps = np.diff(samples)
    return float(np.sqrt(steps @ steps / len(steps)))
