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
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.signal_plan import SignalPlan
from modelgen.runtime.rows.thresholds import PERCENTILE


@dataclass(frozen=True)
class Survey:
    """Speeds below which a mass stands still, by the key of the velocity; where forces of each row jump.

    The latter are looked for where samples are left out for them.
    """

    thresholds: Mapping[str, float]
    jumps: tuple[IntArray, ...] | None = None


NOTHING = Survey({})


def survey_record(parts: Iterator[Chunk], plan: SignalPlan, n: int) -> Survey:
    """Return the survey of a record of n samples, from chunks that keep every sample of it."""
    index = PERCENTILE * (n - 1)
    low = int(index)
    fastest: dict[str, FloatArray] = {key: np.zeros(0) for key in plan.directions}
    for chunk in parts:
        for key in plan.directions:
            speed = np.abs(chunk.direction(key, chunk.start, chunk.stop))
            fastest[key] = _largest(np.concatenate([fastest[key], speed]), n - low)
    thresholds = {}
    for key, values in fastest.items():
        ordered = np.sort(values)
        percentile = ordered[0] + (index - low) * (ordered[min(1, len(ordered) - 1)] - ordered[0])
        thresholds[key] = STANDSTILL_SHARE * float(percentile)
    return Survey(thresholds)


def _largest(values: FloatArray, count: int) -> FloatArray:
    if len(values) <= count:
        return values
    return np.partition(values, len(values) - count)[len(values) - count :]
