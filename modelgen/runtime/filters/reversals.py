"""Masks: which samples lie too near to a reversal or a standstill to be used.

Coulomb friction jumps where a velocity changes sign, and while a mass sticks the friction force is anything
between the two Coulomb levels. A differentiated row drops the friction and is wrong around both; a row that
keeps sign() is right through a quick reversal and wrong during a standstill only.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.filters.thresholds import STANDSTILL_SHARE


def standstill_threshold(velocity: FloatArray) -> float:
    """Return the speed below which a mass stands still: 0.5 % of the 99th percentile of |velocity|.

    `velocity`, shape (n,), and the result have the same unit.
    """
    return STANDSTILL_SHARE * float(np.percentile(np.abs(velocity), 99.0))


def standstills(velocity: FloatArray, min_samples: int, threshold: float | None = None) -> BoolArray:
    """Mark stretches of at least `min_samples` samples in which the mass stands still, shape (n,).

    `threshold` is the speed below which it does; by default that of these samples.
    """
    least = standstill_threshold(velocity) if threshold is None else threshold
    half = min_samples // 2
    if half > 1:
        # so long a stretch holds two neighbours of every half-th sample
        few = np.abs(velocity[::half]) <= least
        if not np.any(few[1:] & few[:-1]):
            return np.zeros(len(velocity), dtype=bool)
    still = np.abs(velocity) <= least
    if min_samples <= 1:
        return np.asarray(still)
    starts, stops = _stretches(still)
    long = stops - starts >= min_samples
    return _within(starts[long], stops[long], len(still))


def reversals(velocity: FloatArray, threshold: float | None = None) -> BoolArray:
    """Mark both samples next to every change of sign, and every sample of standing still, shape (n,)."""
    return standstills(velocity, 1, threshold) | _sign_changes(velocity)


def turns(velocity: FloatArray, threshold: float | None = None) -> BoolArray:
    """Mark both samples next to every change of sign, with the standstill around it, shape (n,).

    What slows down to nothing and goes on the same way has not turned: its sign is known throughout.
    """
    changed = _sign_changes(velocity)
    starts, stops = _stretches(standstills(velocity, 1, threshold) | changed)
    places = np.flatnonzero(changed)
    turned = np.searchsorted(places, starts) < np.searchsorted(places, stops)
    return _within(starts[turned], stops[turned], len(velocity))


def _stretches(marked: BoolArray) -> tuple[IntArray, IntArray]:
    """Return where stretches of marked samples start, and where the first unmarked one follows."""
    edges = np.flatnonzero(np.diff(marked, prepend=False, append=False))
    return edges[::2], edges[1::2]


def _within(starts: IntArray, stops: IntArray, n: int) -> BoolArray:
    """Mark the samples of stretches that do not touch, shape (n,)."""
    steps = np.zeros(n + 1, dtype=np.int8)
    steps[starts], steps[stops] = 1, -1
    return np.asarray(np.cumsum(steps[:n], dtype=np.int8).view(np.bool_))


def _sign_changes(velocity: FloatArray) -> BoolArray:
    marked = np.zeros(len(velocity), dtype=bool)
    changed = velocity[1:] * velocity[:-1] <= 0.0
    marked[:-1] |= changed
    marked[1:] |= changed
    return marked


def widen(marked: BoolArray, reach: int) -> BoolArray:
    """Mark everything within `reach` samples of what is marked, shape (n,)."""
    starts, stops = _stretches(marked)
    apart = starts[1:] - stops[:-1] > 2 * reach
    first = np.concatenate([starts[:1], starts[1:][apart]])
    last = np.concatenate([stops[:-1][apart], stops[-1:]])
    return _within(np.maximum(first - reach, 0), np.minimum(last + reach, len(marked)), len(marked))
