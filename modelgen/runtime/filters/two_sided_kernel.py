"""The kernel of zero-phase filters in cascade, followed by central differences: one even or odd sequence.

A cascade of sections H run forward and backward has the real spectrum |H|^2, a central difference the
imaginary one 2j sum c_k sin(k w) / dt. Their product is sampled without cancellation, whatever the cut-off,
so the kernel of a fourth derivative is as exact as that of the filter itself; differences of a filtered
impulse would lose digits with every derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filters.thresholds import KERNEL_TOLERANCE

Sections = tuple[tuple[float, ...], ...]  # each b0, b1, b2, a0, a1, a2, as SciPy writes them

# A slower pole than this would need tables of millions of samples.
LONGEST_KERNEL = 1 << 20


def squared_gain(sos: FloatArray, half_sine: FloatArray) -> FloatArray:
    """Return |H|^2 of a cascade of second-order sections at the frequencies w, given sin(w / 2)^2.

    `sos` has shape (sections, 6); `half_sine` and the result have shape (frequencies,) and no unit.

    Written in sin(w / 2)^2, |b0 + b1 z^-1 + b2 z^-2|^2 keeps its digits near w = 0, where numerator and
    denominator of a low cut-off nearly vanish.
    """
    total = np.ones_like(half_sine)
    for b0, b1, b2, a0, a1, a2 in sos:
        total *= _squared(b0, b1, b2, half_sine) / _squared(a0, a1, a2, half_sine)
    return total


def kernels(sos: FloatArray, derivatives: Sequence[int], stencil: Sequence[float]) -> FloatArray:
    """Return the kernels h_d[k] of filter and differences, k = 0 ... n - 1, shape (derivatives, n).

    ``h_d[-k]`` is ``h_d[k]`` for even and ``-h_d[k]`` for odd orders d.

    Parameters
    ----------
    sos : array, shape (sections, 6)
        Of one pass; each section is run forward and backward.
    derivatives : sequence of int
        Orders d; the central difference is applied d times.
    stencil : sequence of float
        c_1, c_2, ... of f'(0) = sum c_k (f(k) - f(-k)) / dt; the kernels are those of dt = 1.

    Raises
    ------
    DataError
        When the response of the filter takes more than half a million samples to end.
    """
    n = table_length(sos)
    frequency = np.arange(n // 2 + 1) * (2.0 * np.pi / n)
    gain = squared_gain(sos, np.sin(0.5 * frequency) ** 2)
    slope = sum((2.0 * c * np.sin(k * frequency) for k, c in enumerate(stencil, start=1)), np.zeros(1))
    # 1j**d exactly, no rounding of the other part
    turns = (1.0, 1.0j, -1.0, -1.0j)
    spectra = np.stack([gain * slope**d * turns[d % 4] for d in derivatives])
    return np.asarray(np.fft.irfft(spectra, n)[:, : n // 2], dtype=float)


def slowest_pole(sos: FloatArray) -> complex:
    """Return the pole of second-order sections, (sections, 6), of the largest modulus, dimensionless."""
    poles = [complex(pole) for section in sos for pole in np.roots(section[3:])]
    return max(poles, key=abs, default=0.0 + 0.0j)


def other_cutoff(sos: FloatArray) -> str:
    """Return the cut-off to give where a response, of sections (k, 6) without a unit, is too long.

    It is so next to zero frequency, and next to half the sampling frequency, where poles are near -1.
    """
    return f"give a {'lower' if slowest_pole(sos).real < 0.0 else 'higher'} cut-off frequency"


def kernel_reach(kernel: FloatArray, tolerance: float) -> int:
    """Return the number of samples after which every kernel stays below `tolerance` times its peak.

    Parameters
    ----------
    kernel : array, shape (derivatives, n)
    tolerance : float
    """
    size = np.abs(kernel)
    felt = np.any(size > tolerance * size.max(axis=1, keepdims=True), axis=0)
    return int(np.flatnonzero(felt)[-1]) + 1


def _squared(c0: float, c1: float, c2: float, half_sine: FloatArray) -> FloatArray:
    """Return |c0 + c1 z^-1 + c2 z^-2|^2 on the unit circle, in powers of sin(w / 2)^2."""
    at_zero = (c0 + c1) + c2
    linear = (c0 - c2) ** 2 - at_zero * (c0 + c2)
    return np.asarray(at_zero**2 + 4.0 * half_sine * linear + 16.0 * c0 * c2 * half_sine**2)


def table_length(sos: FloatArray) -> int:
    """Return a power of two at which the tails of the response do not fold back into it.

    Sections have shape (k, 6).

    Raises
    ------
    DataError
        When the response takes more than half a million samples to end.
    """
    if not _ending(sos) <= LONGEST_KERNEL // 2:
        what = f"has a pole at {abs(slowest_pole(sos)):.9g}, so its response takes too long to end"
        raise DataError.at("filter", what, f"{other_cutoff(sos)}, or a stable filter")
    return int(2 ** np.ceil(np.log2(2.0 * max(_ending(sos), 64.0))))


@lru_cache(maxsize=64)
def is_tabled(sos: Sections) -> bool:
    """Return whether the response of sections (6 numbers each) ends within half a million samples."""
    return _ending(np.asarray(sos, dtype=float)) <= LONGEST_KERNEL // 2


def _ending(sos: FloatArray) -> float:
    """Return after how many samples the response is over."""
    radius = abs(slowest_pole(sos))
    if radius == 0.0:
        return 0.0
    # poles that lie close together decay like k^m r^k: half as long again
    return float(1.5 * np.log(KERNEL_TOLERANCE) / np.log(radius)) if radius < 1.0 else float("inf")
