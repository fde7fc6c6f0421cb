"""Signal against noise: every derivative the rows need, behind the filter, beside its channel's own noise.

The noise of a reading is taken as white, at the level of the uppermost fifth of its band. Differentiating
multiplies it by the frequency, so that each derivative needs a motion that is larger by as much; the table
says up to where every derivative stands out, and what is left of it at the cut-off in use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log, log10, pi, sqrt

import numpy as np
import numpy.typing as npt

from modelgen.runtime.choose import FilterChoice
from modelgen.runtime.contract import Model, Signal
from modelgen.runtime.data import Record
from modelgen.runtime.spectrum import NOISE_FACTOR, NOISE_FROM, band_limit_hz

FloatArray = npt.NDArray[np.float64]

# The band in which a derivative stands out holds this share of its power.
BAND_SHARE = 0.999
# Fewer lines above the noise than this, or less of the power, and nothing moves.
FEWEST_LINES = 3
LEAST_POWER = 1e-3
# A reading that travels by so many standard deviations of its noise moves, however steadily.
LEAST_TREND = 20.0


@dataclass(frozen=True)
class SignalToNoise:
    """One derivative of one channel of one record behind the filter.

    `rms` is that of signal and noise together, without the mean; `noise_rms` the noise's, both in `unit`;
    `snr_db` the ratio of powers, None where there is no noise or nothing else. `visible_to_hz` is the
    frequency up to which the derivative stands out of the noise, None where it does nowhere.
    """

    record: str
    channel: str
    derivative: int
    unit: str
    rms: float
    noise_rms: float
    snr_db: float | None
    visible_to_hz: float | None


@dataclass(frozen=True, eq=False)
class ReadingSpectrum:
    """One-sided density of a reading in unit^2/Hz, without mean and trend; `noise` is that of white noise.

    `trend` is by how much the reading drifts over the record, in standard deviations of that noise.
    """

    frequency_hz: FloatArray
    density: FloatArray
    noise: float
    trend: float

    @property
    def clear(self) -> npt.NDArray[np.bool_]:
        """Which lines stand out of the noise."""
        # of white noise the median is ln 2 times the mean
        return np.asarray(self.density > NOISE_FACTOR * log(2.0) * self.noise)

    @property
    def moves(self) -> bool:
        """Whether the reading changes by more than its own noise."""
        clear, total = self.clear, float(self.density.sum())
        lines = clear.sum() >= FEWEST_LINES and self.density[clear].sum() > LEAST_POWER * total > 0.0
        return bool(lines or self.trend > LEAST_TREND)

    def spread(self, fs: float) -> float:
        """Return the standard deviation of the white noise, sampled at `fs` in Hz."""
        return sqrt(0.5 * self.noise * fs)


def reading_spectrum(samples: FloatArray, fs: float) -> ReadingSpectrum:
    """Return the spectrum of a reading; Hann window.

    A trend would hide everything behind the window's own spectrum: the reading is differenced first.
    """
    differenced = np.diff(samples)
    steady = float(differenced.mean())
    differenced = differenced - steady
    n = len(differenced)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    power = 2.0 * np.abs(np.fft.rfft(differenced * window)) ** 2 / (fs * float(np.sum(window**2)))
    frequency_hz = np.fft.rfftfreq(n, 1.0 / fs)[1:]
    density = power[1:] / (2.0 * np.sin(np.pi * frequency_hz / fs)) ** 2
    noise = float(np.median(density[frequency_hz >= NOISE_FROM * 0.5 * fs])) / log(2.0)
    travel, spread = abs(steady) * n, sqrt(0.5 * noise * fs)
    trend = travel / spread if spread > 0.0 else inf if travel > 0.0 else 0.0
    return ReadingSpectrum(np.asarray(frequency_hz, dtype=float), density, noise, trend)


def signal_to_noise(
    model: Model, records: Sequence[Record], choice: FilterChoice
) -> tuple[SignalToNoise, ...]:
    """Return every signal of the model that is a derivative of a channel, record by record."""
    found = []
    for record in records:
        spectra: dict[str, ReadingSpectrum] = {}
        for signal in model.signals:
            channel = signal.sensor or signal.actuator
            if channel is None or channel not in record.signals:
                continue
            if channel not in spectra:
                spectra[channel] = reading_spectrum(record.signals[channel], record.fs)
            found.append(_entry(record.name, channel, signal, spectra[channel], choice))
    return tuple(found)


def gain(frequency_hz: FloatArray, choice: FilterChoice, derivative: int) -> FloatArray:
    """Return the amplitude of the filter, forward and backward, followed by differentiation."""
    ratio = np.minimum(frequency_hz / choice.cutoff_hz, 1e6)
    low_pass = 1.0 / (1.0 + ratio ** (2 * choice.filter_order))
    return np.asarray(low_pass * (2.0 * pi * frequency_hz) ** derivative)


def _entry(
    record: str, channel: str, signal: Signal, spectrum: ReadingSpectrum, choice: FilterChoice
) -> SignalToNoise:
    frequency_hz, density = spectrum.frequency_hz, spectrum.density
    step = float(frequency_hz[1] - frequency_hz[0])
    squared = gain(frequency_hz, choice, signal.derivative) ** 2
    power = float(np.sum(squared * density) * step)
    noise = float(spectrum.noise * np.sum(squared) * step)
    visible = None
    if spectrum.moves:
        seen = np.where(spectrum.clear, density, 0.0) * frequency_hz ** (2 * signal.derivative)
        visible = band_limit_hz(frequency_hz, seen, BAND_SHARE, float(frequency_hz[-1]))
    ratio = power / noise - 1.0 if noise > 0.0 else inf
    snr = 10.0 * log10(ratio) if 0.0 < ratio < inf else None
    return SignalToNoise(
        record, channel, signal.derivative, signal.unit, sqrt(power), sqrt(noise), snr, visible
    )
