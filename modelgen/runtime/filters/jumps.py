"""Where a signal changes faster than its samples show.

What lies beyond half the sampling frequency is folded: of a force that jumps, or bends, the samples do not
tell when in between. A steady motion has little near half the sampling frequency, and noise is even there: a
jump stands out in a high difference.
"""

from __future__ import annotations

from math import comb

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.thresholds import (
    BEND,
    BEND_APART,
    JUMP,
    JUMP_ORDER,
    LEAST_JUMP,
    MEDIAN_OF_NORMAL,
    MOST_JUMPS,
)

# Differences of even order are symmetric: a jump is in the middle.
DIFFERENCE = np.array([comb(JUMP_ORDER, k) * (-1.0) ** k for k in range(JUMP_ORDER + 1)]) / 2.0**JUMP_ORDER


# What it makes of a signal whose slope grows by 1 a sample, there.
BENT = -comb(JUMP_ORDER - 2, JUMP_ORDER // 2 - 1) / 2.0**JUMP_ORDER


def jumps(samples: FloatArray) -> IntArray:
    """Return the samples at which a signal, shape (n,), jumps by more than its noise explains.

    None where many do: that is how the signal is, and its own noise is not known.
    """
    return _standing_out(_high_difference(samples), JUMP, samples) + JUMP_ORDER // 2


def bends(samples: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the samples at which a signal, shape (n,), bends, and by how much its slope grows at each.

    Shape (bends,) each, the second in the signal's unit a sample. Those about halfway between two samples are
    hardly seen.
    """
    high = _high_difference(samples)
    found = _standing_out(high, BEND, samples)
    size = np.pad(np.abs(high), BEND_APART)
    around = np.arange(2 * BEND_APART + 1)
    # the difference rings on both sides of a bend
    found = found[size[found + BEND_APART] >= np.max(size[found[:, None] + around], axis=1, initial=0.0)]
    return found + JUMP_ORDER // 2, high[found] / BENT


def _high_difference(samples: FloatArray) -> FloatArray:
    """Return the difference of a signal, shape (n - order,), the first one around its sample order / 2."""
    if len(samples) <= JUMP_ORDER:
        return np.zeros(0)
    return np.convolve(samples, DIFFERENCE, "valid")


def _standing_out(high: FloatArray, multiple: float, samples: FloatArray) -> IntArray:
    """Return where a difference exceeds that multiple of its noise; nowhere if it does so in many places."""
    none = np.zeros(0, dtype=np.int64)
    if not high.size:
        return none
    size = np.abs(high)
    noise = float(np.median(size)) / MEDIAN_OF_NORMAL
    found = np.flatnonzero(size > max(multiple * noise, LEAST_JUMP * float(np.std(samples))))
    return none if noise == 0.0 or len(found) > MOST_JUMPS * len(samples) else np.asarray(found)
