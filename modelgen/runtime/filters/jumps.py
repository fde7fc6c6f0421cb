"""Where a signal changes faster than its samples show.

What lies beyond half the sampling frequency is folded: of a force that jumps, or bends, the samples do not
tell when in between. A steady motion has little near half the sampling frequency, and noise is even there: a
jump stands out in a high difference.
"""

from __future__ import annotations

from math import comb

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.thresholds import JUMP, JUMP_ORDER, LEAST_JUMP, MEDIAN_OF_NORMAL, MOST_JUMPS

# Differences of even order are symmetric: a jump is in the middle.
DIFFERENCE = np.array([comb(JUMP_ORDER, k) * (-1.0) ** k for k in range(JUMP_ORDER + 1)]) / 2.0**JUMP_ORDER


def jumps(samples: FloatArray) -> IntArray:
    """Return the samples at which a signal, shape (n,), jumps by more than its noise explains.

    None where many do: that is how the signal is, and its own noise is not known.
    """
    none = np.zeros(0, dtype=np.int64)
    if len(samples) <= JUMP_ORDER:
        return none
    size = np.abs(np.convolve(samples, DIFFERENCE, "valid"))
    noise = float(np.median(size)) / MEDIAN_OF_NORMAL
    least = max(JUMP * noise, LEAST_JUMP * float(np.std(samples)))
    found = np.flatnonzero(size > least) + JUMP_ORDER // 2
    return none if noise == 0.0 or len(found) > MOST_JUMPS * len(samples) else np.asarray(found)
