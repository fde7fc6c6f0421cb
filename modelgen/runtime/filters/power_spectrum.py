"""Power spectra of the derivatives or integrals of a reading, without its white noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.thresholds import NOISE_FACTOR, NOISE_FROM


def power_spectrum(
    samples: FloatArray, fs: float, derivative: int = 0, keep_mean: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the power spectrum of a derivative (or integral), Hann-windowed and cleared of white noise.

    A position's noise grows with the fourth power of the frequency in its acceleration: uncleared, it would
    pass for dynamics.

    Parameters
    ----------
    samples : array, shape (n,)
        A reading.
    fs : float
        Sampling frequency in Hz.
    derivative : int
        Derivative to take; negative integrates.
    keep_mean : bool
        Keep the mean (a constant velocity); otherwise it is removed before the window.

    Returns
    -------
    frequency_hz, power : array, shape (about n / 2,)
        Frequencies above zero (and zero itself where the mean is kept); power in arbitrary units, zero where
        there is nothing but noise.
    """
    # a window on a position that travels would bring the window's own derivatives in: difference first
    times = max(derivative, 0)
    differenced = np.diff(samples, n=times)
    if not keep_mean:
        differenced = differenced - differenced.mean()
    n = len(differenced)
    size = quick_length(n)
    power = square(np.fft.rfft(differenced * hann(n), size))
    frequency_hz, _ = lines_of(size, fs)
    of_differences, of_derivative = _powers_of(size, fs, derivative)
    # the power of the reading itself, in which the noise is white
    reading = power / of_differences if times else power
    noise = float(np.median(reading[np.searchsorted(frequency_hz, NOISE_FROM * 0.5 * fs) :]))
    clear = reading > NOISE_FACTOR * noise
    if np.any(clear):  # a flat spectrum looks like noise and is kept as it is
        power = np.where(clear, power, 0.0)
    if derivative:
        power = power * of_derivative
    first = 0 if keep_mean else 1
    return np.asarray(frequency_hz[first:]), np.asarray(power[first:])


@lru_cache(maxsize=8)
def lines_of(size: int, fs: float) -> tuple[FloatArray, FloatArray]:
    """Return the frequencies in Hz of a transform of `size` samples, and what differencing does to each line.

    Both have the shape (size // 2 + 1,), not to be changed; the line at zero counts as 1.
    """
    frequency_hz = np.asarray(np.fft.rfftfreq(size, 1.0 / fs))
    difference = 2.0 * np.sin(np.pi * frequency_hz / fs)
    difference[0] = 1.0
    frequency_hz.flags.writeable = difference.flags.writeable = False
    return frequency_hz, difference


@lru_cache(maxsize=4)
def _powers_of(size: int, fs: float, derivative: int) -> tuple[FloatArray, FloatArray]:
    """Return the power that differencing gives each line, and a derivative as a multiple of that.

    Both have the shape (size // 2 + 1,), not to be changed; an integral is of the reading itself.
    """
    frequency_hz, difference = lines_of(size, fs)
    omega = 2.0 * np.pi * frequency_hz / fs
    omega[0] = 1.0
    of_differences = (difference ** max(derivative, 0)) ** 2
    of_derivative = (omega**derivative) ** 2 / of_differences
    of_differences.flags.writeable = of_derivative.flags.writeable = False
    return np.asarray(of_differences), np.asarray(of_derivative)


@lru_cache(maxsize=8)
def hann(n: int) -> FloatArray:
    """Return Hann's window for a stretch of n samples, shape (n,), not to be changed."""
    window = np.asarray(0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / max(n, 1)))
    window.flags.writeable = False
    return window


def square(lines: npt.NDArray[np.complex128]) -> FloatArray:
    """Return the squared magnitudes of lines of a Fourier transform, in their unit squared, shape (n,)."""
    return np.asarray(lines.real**2 + lines.imag**2)


def integer_power(samples: FloatArray, exponent: int) -> FloatArray:
    """Return an integer power of samples, shape (n,), by few products: `**` takes a logarithm of each."""
    if exponent == 1:
        return samples
    if exponent <= 0:
        return np.ones_like(samples)
    half = integer_power(samples, exponent // 2)
    return half * half * samples if exponent % 2 else half * half


@lru_cache(maxsize=256)
def quick_length(n: int) -> int:
    """Return the least length from n on whose Fourier transform is fast: a product of small primes.

    A transform of prime length takes several times as long; padding with so few zeros changes no density.
    """
    best = 1 << max(n - 1, 0).bit_length()
    fives = 1
    while fives < best:
        odd = fives
        while odd < best:
            # the least power of two that makes it long enough
            best = min(best, odd << max(-(-n // odd) - 1, 0).bit_length())
            odd *= 3
        fives *= 5
    return best


def band_limit_hz(frequency_hz: FloatArray, power: FloatArray, share: float, up_to_hz: float) -> float | None:
    """Return the frequency in Hz below which `share` of the power up to `up_to_hz` lies; None without power.

    `frequency_hz` (ascending) and `power` have shape (n,).
    """
    inside = frequency_hz <= up_to_hz
    cumulated = np.cumsum(power[inside])
    if cumulated.size == 0 or cumulated[-1] <= 0.0:
        return None
    return float(frequency_hz[inside][np.searchsorted(cumulated, share * cumulated[-1])])


def share_below(frequency_hz: FloatArray, power: FloatArray, limit_hz: float) -> float:
    """Return which share of the power lies below a frequency, 0 to 1; 0 without any power.

    `frequency_hz` and `power` have shape (n,).
    """
    total = float(power.sum())
    return float(power[frequency_hz < limit_hz].sum()) / total if total > 0.0 else 0.0
