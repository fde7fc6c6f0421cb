"""The spectrum of one reading and its own noise: which lines exceed it, and up to which frequency.

The noise of a reading is taken as white, at the level of the uppermost fifth of its band.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, log, sqrt

import numpy as np
import numpy.typing as npt

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.filters.power_spectrum import (
    band_limit_hz,
    hann,
    integer_power,
    lines_of,
    quick_length,
    square,
)
from modelgen.runtime.filters.thresholds import (
    BAND_SHARE,
    CALMEST,
    FEWEST_LINES,
    LEAST_POWER,
    LEAST_TREND,
    LOBE,
    NEAR,
    NOISE_FACTOR,
    NOISE_FROM,
)
from modelgen.runtime.numerics.tails import normal_beyond


@dataclass(frozen=True, eq=False)
class ReadingSpectrum:
    """One-sided density of a reading in unit^2/Hz, shape (n,), without mean and trend.

    `noise` is the density of its white noise, `trend` the drift of the reading over the record in standard
    deviations of that noise.
    """

    frequency_hz: FloatArray
    density: FloatArray
    noise: float
    trend: float

    @cached_property
    def clear(self) -> BoolArray:
        """Which lines stand out of the noise, shape (n,)."""
        # of white noise the median is ln 2 times the mean
        return np.asarray(self.density > NOISE_FACTOR * log(2.0) * self.noise)

    @property
    def lines(self) -> bool:
        """Whether lines of the reading stand out of its noise."""
        clear, total = self.clear, float(self.density.sum())
        return bool(clear.sum() >= FEWEST_LINES and self.density[clear].sum() > LEAST_POWER * total > 0.0)

    @property
    def moves(self) -> bool:
        """Whether the reading changes by more than its own noise."""
        return self.lines or self.trend > LEAST_TREND

    def spread(self, fs: float) -> float:
        """Return the standard deviation of the white noise, sampled at `fs` in Hz."""
        return sqrt(0.5 * self.noise * fs)

    def signal(self, derivative: int) -> FloatArray:
        """Return the density of a derivative where it exceeds the noise, shape (n,), in unit^2/s^(2 d)/Hz."""
        return self.differentiated(np.where(self.clear, self.density, 0.0), derivative)

    def differentiated(self, density: FloatArray | float, derivative: int) -> FloatArray:
        """Return the density of a derivative, shape (n,), from that of the reading or from a constant one."""
        return np.asarray(density * integer_power((2.0 * np.pi * self.frequency_hz) ** 2, derivative))

    def visible_to_hz(self, derivative: int) -> float | None:
        """Return the frequency up to which a derivative stands out of its noise; None where nowhere."""
        if not self.moves:
            return None
        return band_limit_hz(
            self.frequency_hz, self.signal(derivative), BAND_SHARE, float(self.frequency_hz[-1])
        )


def tones(density: FloatArray, lines: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Return which lines of a density, in any unit, shape (n,), are tones: far above all others near them.

    `lines` and the result are indices, shape (m,). Friction has a broad spectrum and a periodic motion has
    many lines: neither counts as a tone.
    """
    found = []
    for line in lines:
        reach = max(int(NEAR * line), 2 * LOBE)
        below = density[max(line - reach, 0) : max(line - LOBE, 0)]
        above = density[line + LOBE + 1 : line + reach + 1]
        if density[line] > NOISE_FACTOR * max(below.max(initial=0.0), above.max(initial=0.0)):
            found.append(line)
    return np.array(found, dtype=np.intp)


def reading_spectrum(samples: FloatArray, fs: float) -> ReadingSpectrum:
    """Return the spectrum of a reading, shape (n,) in its SI unit, with a Hann window; `fs` in Hz.

    The reading is differenced first, because the spectrum of a windowed trend would cover everything else.
    """
    differenced = np.diff(samples)
    steady = float(differenced.mean())
    differenced = differenced - steady
    n = len(differenced)
    window, size = hann(n), quick_length(n)
    power = 2.0 * square(np.fft.rfft(differenced * window, size)) / (fs * float(np.sum(window**2)))
    frequency_hz, difference = (lines[1:] for lines in lines_of(size, fs))
    density = power[1:] / difference**2
    first = np.searchsorted(frequency_hz, NOISE_FROM * 0.5 * fs)
    noise = float(np.median(density[first:])) / log(2.0)
    travel, spread = abs(steady) * n, sqrt(0.5 * noise * fs)
    trend = travel / spread if spread > 0.0 else inf if travel > 0.0 else 0.0
    return ReadingSpectrum(frequency_hz, density, noise, trend)


def calm_noise(samples: FloatArray, fs: float) -> float:
    """Return the density of white noise that the calmest samples show, in unit^2/Hz; 0 at rest.

    A binary force takes a step every few samples, which are most of its second differences.

    Parameters
    ----------
    samples : array, shape (n,)
        In any unit.
    fs : float
        Sampling frequency in Hz.
    """
    changes = np.abs(np.diff(samples, 2))
    # second differences of normal noise have six times its variance; those of coarse readings are often zero
    found = [float(np.quantile(changes, share)) / normal_beyond(0.5 - 0.5 * share) for share in CALMEST]
    least = min((one for one in found if one > 0.0), default=0.0)
    return 2.0 * least**2 / 6.0 / fs


def mean_spectrum(spectra: Sequence[ReadingSpectrum]) -> ReadingSpectrum:
    """Return the mean of the spectra of stretches of equal length; the largest trend of them."""
    if len(spectra) == 1:
        return spectra[0]
    density = np.mean([one.density for one in spectra], axis=0)
    noise = float(np.mean([one.noise for one in spectra]))
    return ReadingSpectrum(spectra[0].frequency_hz, density, noise, max(one.trend for one in spectra))


def low_pass(frequency_hz: FloatArray, cutoff_hz: float, order: int, fs: float | None = None) -> FloatArray:
    """Return the amplitude of a Butterworth, forward and backward, at frequencies in Hz, shape (n,).

    Sampled at `fs` in Hz, or analogue without it.
    """
    ratio = frequency_hz / cutoff_hz
    if fs is not None:  # the bilinear transform bends the axis of frequencies
        below = np.minimum(frequency_hz / fs, 0.5 - 1e-9)
        ratio = np.tan(np.pi * below) / np.tan(np.pi * cutoff_hz / fs)
    return np.asarray(1.0 / (1.0 + integer_power(np.minimum(ratio, 1e6) ** 2, order)))
