"""Survey: the numbers of a whole record that its chunks need, gathered in constant memory.

The speed below which a mass stands still is a share of the 99th percentile of its speed: an exact one, for
which only the fastest hundredth of the samples is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.thresholds import STANDSTILL_SHARE
from modelgen.runtime.rows.thresholds import PERCENTILE


@dataclass(frozen=True)
class Survey:
    """Speeds below which a mass stands still, by the key of the velocity; where forces of each row jump.

    The latter are looked for where samples are left out for them.
    """

    thresholds: Mapping[str, float]
    jumps: tuple[IntArray, ...] | None = None


NOTHING = Survey({})


def standstill_speed(velocities: Iterator[FloatArray], n: int) -> FloatArray:
    """Return the speed below which a mass stands still, shape (1,), from its velocity at n samples."""
    index = PERCENTILE * (n - 1)
    low = int(index)
    fastest = np.zeros(0)
    for velocity in velocities:
        speed = np.abs(velocity)
        # once the fastest are known, most of the others need not be looked at again
        least = fastest.min() if len(fastest) == n - low else -np.inf
        fastest = _largest(np.concatenate([fastest, speed[speed > least]]), n - low)
    ordered = np.sort(fastest)
    percentile = ordered[0] + (index - low) * (ordered[min(1, len(ordered) - 1)] - ordered[0])
    return np.array([STANDSTILL_SHARE * percentile])


def _largest(values: FloatArray, count: int) -> FloatArray:
    if len(values) <= count:
        return values
    return np.partition(values, len(values) - count)[len(values) - count :]
