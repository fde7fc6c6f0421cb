"""The slowest cosines of samples, by least squares.

A filter would begin with the first sample, be it a peak.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.thresholds import COSINES_KEPT
from modelgen.runtime.numerics.recent_arrays import RecentArrays

_TABLES = RecentArrays(8 * COSINES_KEPT)  # bytes


def slowest(samples: FloatArray, count: int) -> FloatArray:
    """Return the sum of the first `count` cosines of samples, in their unit, shape (n,), of shape (n,).

    The k-th one, from 0, has k half periods over all samples. A few are products with their table, in place
    of transforms of a length that may have large prime factors.
    """
    n = len(samples)
    if n * count <= COSINES_KEPT:
        wide = min(count, n)
        table = _TABLES.of((n, wide), lambda: _cosines(n, wide))
        return np.asarray(table @ (samples @ table))
    from scipy.fft import dct, idct

    spectrum = dct(samples, norm="ortho")
    spectrum[count:] = 0.0
    return np.asarray(idct(spectrum, norm="ortho"))


def _cosines(n: int, count: int) -> FloatArray:
    """Return orthonormal cosines, a column each, shape (n, count)."""
    half_periods = (np.arange(n)[:, None] + 0.5) / n * np.arange(count)
    table = np.cos(np.pi * half_periods) * np.sqrt(2.0 / n)
    table[:, :1] = np.sqrt(1.0 / n)
    return np.asarray(table)
