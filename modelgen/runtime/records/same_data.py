"""The same data given twice: it adds no information, but would make every interval smaller.

Records are compared by what they hold, whatever their files, formats, names and tags: whole records of equal
length up to a factor and to rounding (a table of seven digits and the binary file), and, where they are in
memory, any stretch that two records share sample by sample. Data with noise of its own is never that equal:
the difference of two records of one motion is larger than the noise of either, however small that is, that of
a record and its rounded copy is at most the rounding of the copy.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from math import comb
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.records.channels import Channels, with_extremes
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import EXACT, NEAR, ROUNDING, SHARED, TWICE

#: Stretches at which two records are looked at first, and the samples of each.
STRETCHES, WIDTH = 16, 32
#: Samples that are compared at a time.
CHUNK = 1 << 18


def refuse_same_data(sources: Sequence[Channels], channels: Sequence[str]) -> None:
    """Refuse two records with the same data.

    Parameters
    ----------
    sources : sequence of Channels
    channels : sequence of str
        What is compared: the channels that the model uses.

    Raises
    ------
    DataError
        With one problem for every pair, which names both.
    """
    if len(sources) < 2 or not channels:
        return
    looks = [look(source, channels) for source in sources]
    found = {
        (i, k): sources[i].n for i, k in alike(looks) if same_throughout(sources[i], sources[k], channels)
    }
    refuse_pairs([(one.name, one.n) for one in sources], {**_stretches(sources, channels), **found})


def refuse_pairs(records: Sequence[tuple[str, int]], shared: Mapping[tuple[int, int], int]) -> None:
    """Refuse records (name, samples) that share so many samples, by their places in the sequence.

    Raises
    ------
    DataError
    """
    problems = []
    for (first, second), n in sorted(shared.items()):
        (a, a_samples), (b, b_samples) = records[first], records[second]
        whole = n == a_samples == b_samples
        what = f"holds the same data as {a}" if whole else f"shares {n} samples with {a}"
        if a == b:
            what += f" (records {first + 1} and {second + 1})"
        remedy = "leave one of them out: data that counts twice makes the intervals too small"
        problems.append(Problem(b, what, remedy))
    DataError.raise_any(problems)


def contents(source: Channels, channels: Sequence[str]) -> tuple[str, ...]:
    """Return a text for each channel that a record has, the same for the same samples only (SHA-256).

    A channel that never changes is left out: it may be the same in any other record.
    """
    found = []
    for channel in channels:
        if channel in source.keys:
            digest, least, greatest = sha256(), np.inf, -np.inf
            for samples, lowest, highest in with_extremes(source, channel):
                digest.update(np.ascontiguousarray(samples, dtype="<f8").data)
                least, greatest = min(least, lowest), max(greatest, highest)
            found += [digest.hexdigest()[:32]] if least < greatest else []
    return tuple(found)


class Contents(Sequence[str]):
    """The `contents` of records, one after the other, worked out when they are asked for.

    Saved, they are a plain tuple.
    """

    def __init__(self, records: Sequence[Channels], channels: Sequence[str]) -> None:
        self._records, self._channels = records, channels

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(text for one in self._records for text in contents(one, self._channels))

    def __getitem__(self, index: Any) -> Any:
        return self.texts[index]

    def __len__(self) -> int:
        return len(self.texts)

    def __reduce__(self) -> tuple[Any, ...]:
        return tuple, (self.texts,)


def is_held_out(source: Channels, channels: Sequence[str], used: Collection[str]) -> bool:
    """Return whether a record is none of those used, which are known by `contents`, or by their names."""
    return source.name not in used and not set(contents(source, channels)) & set(used)


def alike(looks: Sequence[FloatArray]) -> list[tuple[int, int]]:
    """Return the pairs of records that look the same; one array a record, without unit, see `look`, (k,)."""
    groups: dict[int, list[int]] = {}
    for index, one in enumerate(looks):
        groups.setdefault(one.size, []).append(index)
    pairs = []
    for indices in groups.values():
        table = np.array([looks[index] for index in indices])
        coarse = table[:, ::WIDTH]  # a few samples distinguish most records
        for place in range(len(indices) - 1):
            near = 1 + place + np.flatnonzero(np.abs(coarse[place + 1 :] - coarse[place]).max(axis=1) < NEAR)
            near = near[np.abs(table[near] - table[place]).max(axis=1) < NEAR]
            pairs += [(indices[place], indices[other]) for other in near.tolist()]
    return pairs


def look(source: Channels, channels: Sequence[str]) -> FloatArray:
    """Return a record's length and some samples, shape (k,), in units of the largest of each channel."""
    starts = np.unique(np.linspace(0, max(0, source.n - WIDTH), STRETCHES).astype(int))
    looks = [np.array([float(source.n)])]
    for channel in channels:
        parts = [source.read(channel, start, min(start + WIDTH, source.n)) for start in starts.tolist()]
        samples = np.nan_to_num(np.concatenate(parts), posinf=0.0, neginf=0.0)
        looks.append(samples / (np.abs(samples).max() or 1.0))
    return np.concatenate(looks)


def same_throughout(first: Channels, second: Channels, channels: Sequence[str]) -> bool:
    """Return whether two records of one length are the same in all channels, up to factors and rounding."""
    return first.n == second.n and all(_agrees(first, second, channel) for channel in channels)


def _agrees(first: Channels, second: Channels, channel: str) -> bool:
    """Return whether a channel of two records is the same up to a factor and to rounding."""
    factor, peak = _factor(first, second, channel)
    noise, products = np.zeros(2), np.zeros(3)
    for start in range(0, first.n, CHUNK):
        stop = min(start + CHUNK, first.n)
        a, b = (np.asarray(source.read(channel, start, stop)) for source in (first, second))
        with np.errstate(invalid="ignore"):
            apart = a * factor - b
            if not np.all((np.abs(apart) <= ROUNDING * peak) | (np.isnan(a) & np.isnan(b))):
                return False
        known = np.isfinite(apart)
        a, b, apart = a[known] * factor, b[known], apart[known]
        noise += [_noise(a) @ _noise(a), _noise(b) @ _noise(b)]
        products += [apart @ apart, apart @ a, a @ a]
    # the factor is that of one rounded sample
    left = products[0] - products[1] ** 2 / products[2] if products[2] else 0.0
    return bool(left <= max(TWICE**2 * noise.max(), first.n * (EXACT * peak) ** 2))


def _noise(samples: FloatArray) -> FloatArray:
    """Return what is as large as the noise of samples and holds little else, shape (n - 6,)."""
    return np.asarray(np.diff(samples, 6) / np.sqrt(comb(12, 6)))


def _factor(first: Channels, second: Channels, channel: str) -> tuple[float, float]:
    """Return what brings one record to another, from where it is largest, and the size of the other."""
    best, factor, size = 0.0, 1.0, 0.0
    for start in range(0, first.n, CHUNK):
        stop = min(start + CHUNK, first.n)
        a, b = (np.nan_to_num(np.asarray(source.read(channel, start, stop))) for source in (first, second))
        size = max(size, float(np.abs(b).max()))
        index = int(np.argmax(np.abs(a)))
        if abs(a[index]) > best:
            best, factor = float(abs(a[index])), float(b[index] / a[index])
    return factor or 1.0, size


def _stretches(sources: Sequence[Channels], channels: Sequence[str]) -> dict[tuple[int, int], int]:
    """Return the pairs of records in memory that share a stretch, and its samples.

    Where two records overlap, one of them begins within the other: the first changing samples of each are
    looked for in all others.
    """
    records = {
        i: source.signals
        for i, source in enumerate(sources)
        if isinstance(source, Record) and source.in_memory
    }
    if len(records) < 2:
        return {}
    head = next(iter(records.values()))
    channel = max(channels, key=lambda name: len(np.unique(head[name][: 16 * SHARED])))
    anchors = {}
    for index, signals in records.items():
        changes = np.flatnonzero(np.diff(signals[channel]))
        if changes.size and changes[0] + 1 + SHARED <= len(signals[channel]):
            anchors[index] = int(changes[0]) + 1
    values = np.array([records[index][channel][place] for index, place in anchors.items()])
    found: dict[tuple[int, int], int] = {}
    for index, signals in records.items():
        samples = signals[channel]
        hits = np.flatnonzero(np.isin(samples[: len(samples) - SHARED + 1], values))
        for other, place in anchors.items():
            pair = min(index, other), max(index, other)
            if other != index and pair not in found:
                for mine, its in _shared(signals, records[other], channel, hits, place):
                    if all(
                        np.array_equal(signals[name][mine], records[other][name][its]) for name in channels
                    ):
                        found[pair] = mine.stop - mine.start
                        break
    return found


def _shared(
    signals: Mapping[str, FloatArray],
    others: Mapping[str, FloatArray],
    channel: str,
    hits: npt.NDArray[np.intp],
    place: int,
) -> Iterator[tuple[slice, slice]]:
    """Yield where one record may overlap another, whose sample at `place` may stand at one of `hits`."""
    samples, sought = signals[channel], others[channel][place : place + SHARED]
    for offset in range(SHARED):
        if not hits.size:
            return
        hits = hits[samples[hits + offset] == sought[offset]]
    for shift in (hits - place).tolist():
        start, stop = max(0, shift), min(len(samples), shift + len(others[channel]))
        yield slice(start, stop), slice(start - shift, stop - shift)
