"""The same data given twice: two records of which one is, or holds, a stretch of the other.

Data that are counted twice shrink the intervals by the square root of two. Names and files tell nothing: a
copy has another name, another format or another beginning. Records are therefore compared by content: at
samples that their own values pick, a few samples of all channels are hashed; noise never repeats itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from modelgen.errors import Problem
from modelgen.runtime.records.record import Record

FloatArray = npt.NDArray[np.float64]
HashArray = npt.NDArray[np.uint64]
IntArray = npt.NDArray[np.int64]

# Samples hashed at each place; places in the shortest record, about; and how many must agree, and what share
# of the places of the shorter stretch: a quantised reading may repeat itself here and there by chance.
WINDOW = 16
PLACES = 512
FEWEST = 4
LEAST_SHARE = 0.5
COUNTED_ONCE = "leave one of them out: data that are counted twice make every interval too narrow"
# Odd constants of 64-bit hashes: the golden ratio's, and SplitMix64's (Steele 2014).
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX = np.uint64(0xBF58476D1CE4E5B9)


def same_data_problems(records: Sequence[Record], channels: Sequence[str]) -> list[Problem]:
    """Return one problem for each pair of records that hold the same data in all these channels."""
    if len(records) < 2:
        return []
    shared = [key for key in channels if all(key in record.signals for record in records)]
    if not shared:
        return []
    level = max(0, int(np.log2(min(record.n for record in records) / PLACES)))
    pairs = list(combinations(range(len(records)), 2))
    found = [_problem(records, i, k, 0) for i, k in pairs if _equal(records[i], records[k], shared)]
    marks = [_marks([record.signals[key] for key in shared], level) for record in records]
    for first, second in pairs:
        if not _equal(records[first], records[second], shared):
            offset = _common_offset(marks[first], marks[second])
            if offset is not None:
                found.append(_problem(records, first, second, offset))
    return found


def _equal(one: Record, other: Record, channels: Sequence[str]) -> bool:
    return one.n == other.n and all(np.array_equal(one.signals[key], other.signals[key]) for key in channels)


def _marks(signals: Sequence[FloatArray], level: int) -> tuple[HashArray, IntArray]:
    """Return hashes of short windows and where they begin, at samples picked by their own values.

    One sample of 2 ** level is picked; windows in which nothing changes are left out.
    """
    n = len(signals[0])
    own = np.zeros(n, dtype=np.uint64)
    for samples in signals:
        # -0.0 and 0.0 are one reading
        own = (own ^ _bits(samples)) * GOLDEN
        own ^= own >> np.uint64(29)
    picked = np.flatnonzero((own * MIX) >> np.uint64(64 - level) == 0) if level else np.arange(n)
    picked = picked[picked <= n - WINDOW]
    windows = own[picked[:, None] + np.arange(WINDOW)]
    changing = np.any(windows != windows[:, :1], axis=1)
    hashes = np.zeros(int(changing.sum()), dtype=np.uint64)
    for column in windows[changing].T:
        hashes = (hashes ^ column) * MIX
        hashes ^= hashes >> np.uint64(31)
    return hashes, picked[changing].astype(np.int64)


def _bits(samples: FloatArray) -> HashArray:
    return np.ascontiguousarray(samples + 0.0, dtype=np.float64).view(np.uint64)


def _common_offset(first: tuple[HashArray, IntArray], second: tuple[HashArray, IntArray]) -> int | None:
    """Return by how many samples the second record begins later, where the two overlap; else None."""
    # a hash that comes twice within a record says nothing of where
    once = [np.unique(hashes, return_index=True, return_counts=True) for hashes, _ in (first, second)]
    (a, where_a, count_a), (b, where_b, count_b) = once
    _, in_a, in_b = np.intersect1d(a, b, assume_unique=True, return_indices=True)
    alone = (count_a[in_a] == 1) & (count_b[in_b] == 1)
    place_a, place_b = first[1][where_a[in_a[alone]]], second[1][where_b[in_b[alone]]]
    if len(place_a) < FEWEST:
        return None
    offsets, counts = np.unique(place_a - place_b, return_counts=True)
    offset, agreeing = int(offsets[np.argmax(counts)]), int(counts.max())
    low = max(int(first[1][0]), int(second[1][0]) + offset)
    high = min(int(first[1][-1]), int(second[1][-1]) + offset)
    both = min(
        int(np.sum((first[1] >= low) & (first[1] <= high))),
        int(np.sum((second[1] + offset >= low) & (second[1] + offset <= high))),
    )
    return offset if agreeing >= max(FEWEST, LEAST_SHARE * both) else None


def _problem(records: Sequence[Record], first: int, second: int, offset: int) -> Problem:
    one, other = records[first], records[second]
    low, high = max(0, offset), min(one.n, other.n + offset)
    if offset == 0 and one.n == other.n:
        what = "hold the same data"
    else:
        what = (
            f"hold the same data: samples {low} to {high - 1} of the one are samples {low - offset} to "
            f"{high - 1 - offset} of the other"
        )
    where = f"records {first + 1} ({one.name}) and {second + 1} ({other.name})"
    return Problem(where, what, COUNTED_ONCE)
