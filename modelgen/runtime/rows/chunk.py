"""Chunk: a stretch of a record with its halos; no state passes from one to the next.

Chunks can therefore be worked on in any order, by threads, processes and machines, and the sum of their
factors is that of the whole record.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.model import Feature
from modelgen.runtime.records.channels import Channels, not_finite, read_continued
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import MOST_FILTERED
from modelgen.runtime.rows.signal_plan import SignalPlan

# Samples between halos; and at least so many halos, so that these take a small part of the work.
CHUNK_SAMPLES = 1 << 16
HALOS = 8
# The lines of a kernel, some hundreds at the full rate, make a sample as many times as large.
KERNEL_SAMPLES = 1 << 14
# Directions are kept in parts of so many samples; at both ends of a record they go on for multiples of these.
DIRECTION_PART, BEYOND_ENDS = 1 << 15, 1 << 12
KERNEL_HALOS = 2


class Chunk:
    """Samples kept of a stretch of a record, in SI, and what lies around them.

    Attributes
    ----------
    first, count : int
        First sample kept, and how many, each `factor` samples after the other.
    index : int
        Position of the first one on the grid of the record.
    start, stop : int
        Samples of the record from the first to behind the last one kept.
    """

    def __init__(
        self, source: Channels, plan: SignalPlan, first: int, index: int, count: int, halo: int
    ) -> None:
        self.source = source
        self.plan = plan
        self.first = first
        self.index = index
        self.count = count
        self.start, self.stop = first, first + (count - 1) * plan.filtering.factor + 1
        self.halo = halo
        self._channels: dict[str, FloatArray] = {}
        self._directions: dict[str, FloatArray] = {}

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples of a channel, shape (n,); those near the chunk are read once."""
        before, behind = self.plan.margins
        low, high = self.start - before - self.halo, self.stop + behind + self.halo
        if channel not in self.plan.full_rate_channels or start < low or stop > high:
            return read_continued(self.source, channel, start, stop)
        if channel not in self._channels:
            self._channels[channel] = read_continued(self.source, channel, low, high)
        return self._channels[channel][start - low : stop - low]

    def filtered(self, channel: str, key: Hashable, make: Callable[[], npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Return what is made of a channel at the samples kept, shape (count, ...), see `made_once`."""
        return made_once(self.source, channel, (key, self.first, self.count), make)

    def not_finite(self, channel: str, start: int, stop: int) -> DataError:
        """Return the error that names the sample of a channel that is not finite."""
        return not_finite(self.source, channel, start, stop)

    def direction(self, key: str, start: int, stop: int) -> FloatArray:
        """Return samples of a velocity whose sign is a direction of motion, shape (n,)."""
        before, behind = self.plan.feature_margins
        low = self.start - max(before, self.halo)
        if key not in self._directions:
            self._directions[key] = self._direction(key, low, self.stop + max(behind, self.halo))
        return self._directions[key][start - low : stop - low]

    def _direction(self, key: str, low: int, high: int) -> FloatArray:
        """Return such a velocity; in parts that are the same for all chunks, where these are kept."""
        channel, smooth = self.plan.directions[key]
        if smooth is None or not is_kept(self.source):
            return self.plan.direction(self, key, low, high)
        ends = -(-max(*self.plan.feature_margins, self.halo) // BEYOND_ENDS) * BEYOND_ENDS
        edges = [-ends, *range(DIRECTION_PART, self.source.n, DIRECTION_PART), self.source.n + ends]
        parts = [part for part in pairwise(edges) if part[0] < high and part[1] > low]
        made = [
            made_once(self.source, channel, (smooth, *part), partial(self.plan.direction, self, key, *part))
            for part in parts
        ]
        first = parts[0][0]
        return np.concatenate(made)[low - first : high - first]

    def signals(self) -> KeptSignals:
        """Return every signal, feature and the constant "1" at the samples kept; made when asked for."""
        return KeptSignals(self)


class KeptSignals(Mapping[str, FloatArray]):
    """Signals, features and the constant "1" of a chunk at the samples kept, each made when first asked for.

    `force_power` holds, per number of differentiations, the sum of the squared forces that have been made.
    """

    def __init__(self, chunk: Chunk) -> None:
        self.chunk = chunk
        self.force_power: dict[int, float] = {}
        self._made: dict[str, FloatArray] = {"1": np.full(chunk.count, chunk.plan.constant)}

    def __getitem__(self, key: str) -> FloatArray:
        plan, chunk = self.chunk.plan, self.chunk
        if key in plan.signals:
            channel, column = plan.signals[key]
            if channel not in self._made:
                self._made[channel] = chunk.filtered(
                    channel,
                    plan.operators[channel],
                    lambda: plan.table(chunk, channel, chunk.first, chunk.count),
                )
                for times, place in plan.forces.get(channel, {}).items():
                    lever = plan.levers[channel]
                    power = float(np.sum((lever * self._made[channel][:, place]) ** 2))
                    self.force_power[times] = self.force_power.get(times, 0.0) + power
            return self._made[channel][:, column]
        if key not in self._made and key in plan.features and plan.features[key].function == "kernel":
            self._made |= plan.kernel_features(chunk, chunk.first, chunk.count)
        if key not in self._made:
            self._made[key] = self._feature(plan.features[key])
        return self._made[key]

    def _feature(self, feature: Feature) -> FloatArray:
        plan, chunk = self.chunk.plan, self.chunk

        def make() -> FloatArray:
            return plan.feature(chunk, feature, chunk.first, chunk.count)

        if feature.times is not None or not isinstance(feature.of, str):
            return make()
        channel, smooth = plan.directions[feature.of]
        return chunk.filtered(channel, (feature, smooth, plan.feature_operator, plan.filtering.between), make)

    def forget(self, row: int) -> None:
        """Let go what no row after this one needs."""
        for name in [name for name in self._made if self.chunk.plan.last_use.get(name, -1) == row]:
            del self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.chunk.plan.signals, *self.chunk.plan.features, "1"))

    def __len__(self) -> int:
        return len(self.chunk.plan.signals) + len(self.chunk.plan.features) + 1


def made_once(
    source: Channels, channel: str, key: Hashable, make: Callable[[], npt.NDArray[Any]]
) -> npt.NDArray[Any]:
    """Return what is made of a channel; once, of a record in memory that is not long. The key says how.

    The array may have any shape and unit.
    """
    if not isinstance(source, Record) or not is_kept(source):
        return make()
    return source.facts.channels[channel].filtered.of(key, make)


def is_kept(source: Channels) -> bool:
    """Tell whether what is made of channels is kept: of a record in memory that is not long."""
    return isinstance(source, Record) and source.in_memory and source.n <= MOST_FILTERED


def chunk_points(plan: SignalPlan, halo: int = 0, samples: int | None = None) -> int:
    """Return how many points of the grid a chunk has; parameters as of `chunks`."""
    least, halos = (CHUNK_SAMPLES, HALOS) if plan.kernel is None else (KERNEL_SAMPLES, KERNEL_HALOS)
    size = samples or max(least, halos * (max(plan.margins) + halo))
    # whole blocks: the products are then the same whatever the size of a chunk
    block = plan.feature_operator.block
    return -(-size // block) * block // plan.filtering.factor


def chunks(
    source: Channels, plan: SignalPlan, grid: range, halo: int = 0, samples: int | None = None
) -> Iterator[Chunk]:
    """Cut the grid of samples kept into chunks.

    Parameters
    ----------
    source : Channels
    plan : SignalPlan
    grid : range
        Samples of the record that are kept.
    halo : int
        Samples beyond the plan's margins that the masks look at.
    samples : int, optional
        Samples in a chunk; changes memory and speed, never the result.
    """
    count = chunk_points(plan, halo, samples)
    for index in range(0, len(grid), count):
        kept = grid[index : index + count]
        yield Chunk(source, plan, kept[0], index, len(kept), halo)
