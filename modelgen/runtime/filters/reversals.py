"""Masks: which samples lie too near to a reversal or a standstill to be used.

Coulomb friction jumps where a velocity changes sign, and while a mass sticks the friction force is anything
between the two Coulomb levels. A differentiated row drops the friction and is wrong around both; a row that
keeps sign() is right through a quick reversal and wrong during a standstill only.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
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
    still = np.abs(velocity) <= (standstill_threshold(velocity) if threshold is None else threshold)
    marked = np.zeros(len(velocity), dtype=bool)
    for start, stop in _stretches(still):
        if stop - start >= min_samples:
            marked[start:stop] = True
    return marked


def reversals(velocity: FloatArray, threshold: float | None = None) -> BoolArray:
    """Mark both samples next to every change of sign, and every sample of standing still, shape (n,)."""
    return standstills(velocity, 1, threshold) | _sign_changes(velocity)


def turns(velocity: FloatArray, threshold: float | None = None) -> BoolArray:
    """Mark both samples next to every change of sign, with the standstill around it, shape (n,).

    What slows down to nothing and goes on the same way has not turned: its sign is known throughout.
    """
    changed = _sign_changes(velocity)
    marked = standstills(velocity, 1, threshold) | changed
    for start, stop in _stretches(marked):
        marked[start:stop] = changed[start:stop].any()
    return marked


def _stretches(marked: BoolArray) -> list[tuple[int, int]]:
    """Return where stretches of marked samples start, and where the first unmarked one follows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(np.int8), [0]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _sign_changes(velocity: FloatArray) -> BoolArray:
    marked = np.zeros(len(velocity), dtype=bool)
    changes = np.flatnonzero(velocity[1:] * velocity[:-1] <= 0.0)
    marked[changes] = True
    marked[changes + 1] = True
    return marked


def widen(marked: BoolArray, reach: int) -> BoolArray:
    """Mark everything within `reach` samples of what is marked, shape (n,)."""
    n = len(marked)
    counted = np.concatenate([[0], np.cumsum(marked)])
    place = np.arange(n)
    first, last = np.maximum(place - reach, 0), np.minimum(place + reach + 1, n)
    return np.asarray(counted[last] > counted[first])
