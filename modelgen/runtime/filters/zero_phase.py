"""Zero-phase filters: the Butterworth run forward and backward, its reach in time, MATLAB's decimate."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.one_pass import forward_and_backward

# Chebyshev I of MATLAB's `decimate`: order, ripple in dB, cut-off as a fraction of the new Nyquist frequency
DECIMATE_ORDER = 8
MOST_REACH = 10_000_000  # samples of an impulse response, either way
DECIMATE_RIPPLE_DB = 0.05
DECIMATE_CUTOFF = 0.8


def zero_phase(samples: FloatArray, order: int, cutoff_hz: float, fs: float) -> FloatArray:
    """Low-pass samples with a Butterworth filter run forward and backward.

    Parameters
    ----------
    samples : array, shape (n,)
        More than ``3 * order`` of them: so many are mirrored (odd) at both ends.
    order : int
        Order of one pass; two passes have the amplitude 1 / (1 + (f / cutoff_hz)**(2 * order)).
    cutoff_hz, fs : float
        Cut-off (-3 dB of one pass) and sampling frequency in Hz.

    Returns
    -------
    array, shape (n,)
    """
    return forward_and_backward(butterworth(order, cutoff_hz, fs), samples, 3 * order)


@lru_cache(maxsize=64)
def support_samples(order: int, cutoff_hz: float, fs: float, derivative: int, tolerance: float) -> int:
    """Return how far the two-sided response of filter and differentiator reaches, in samples.

    Beyond it the response to an impulse stays below `tolerance` times its own peak: a disturbance at one
    sample (a jump of the friction, the end of the record) is not felt farther away than this.
    """
    half = int(np.ceil((2.0 - np.log10(tolerance)) * order * fs / cutoff_hz)) + 8 * (derivative + 1)
    if half > MOST_REACH:
        what = f"of {cutoff_hz:g} Hz reaches over {2 * half:.3g} samples at {fs:g} Hz"
        raise DataError.at("cut-off", what, "give a higher cut-off")
    impulse = np.zeros(2 * half + 1)
    impulse[half] = 1.0
    low_passed = forward_and_backward(butterworth(order, cutoff_hz, fs), impulse, 0)
    response = np.abs(differentiate(low_passed, 1.0, derivative))
    # the ends of the array are ends of a record too: differences there are one-sided
    inside = response[half : 2 * half - 4 * derivative]
    return int(np.flatnonzero(inside > tolerance * inside.max())[-1]) + 1


def decimation_start(n: int, factor: int) -> int:
    """Return the first sample that MATLAB's `decimate` keeps of n samples."""
    kept = -(-n // factor)
    return factor - (factor * kept - n) - 1


def matlab_decimate(samples: FloatArray, factor: int) -> FloatArray:
    """Decimate as MATLAB's `decimate` does: Chebyshev I of order 8, forward and backward, then pick samples.

    Parameters
    ----------
    samples : array, shape (n,) or (n, columns)
        More than 24 samples.
    factor : int
        1 returns the samples unchanged.

    Returns
    -------
    array, shape (ceil(n / factor),) or (ceil(n / factor), columns)
    """
    if factor == 1:
        return samples
    from scipy.signal import cheby1, sosfiltfilt

    sos = cheby1(DECIMATE_ORDER, DECIMATE_RIPPLE_DB, DECIMATE_CUTOFF / factor, output="sos")
    smooth = sosfiltfilt(sos, samples, axis=0, padtype="odd", padlen=3 * DECIMATE_ORDER)
    return np.asarray(smooth[decimation_start(len(samples), factor) :: factor], dtype=float)
