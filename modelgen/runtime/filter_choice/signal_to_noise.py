"""Signal against noise: every derivative the rows need, behind the filter, and its channel's own noise.

The noise of a reading is taken as white, at the level of the uppermost fifth of its band. Differentiating
multiplies it by the frequency, so that each derivative needs a motion that is larger by as much; the table
says up to where every derivative stands out, and what is left of it at the cut-off in use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, log10, pi, sqrt

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.thresholds import HIGHEST, NOISE_LINES
from modelgen.runtime.filters.noise_spectrum import low_pass
from modelgen.runtime.filters.power_spectrum import integer_power
from modelgen.runtime.model.model import Model, Signal
from modelgen.runtime.records.record import Record


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


def signal_to_noise(
    model: Model, records: Sequence[Record], choice: FilterChoice
) -> tuple[SignalToNoise, ...]:
    """Return every signal of the model that is a derivative of a channel, record by record."""
    found = []
    for record in records:
        for signal in model.signals:
            channel = signal.sensor or signal.actuator
            if channel is None or channel not in record.signals:
                continue
            found.append(_entry(record, channel, signal, choice))
    return tuple(found)


def gain(frequency_hz: FloatArray, choice: FilterChoice, derivative: int, fs: float) -> FloatArray:
    """Return the amplitude of the filter at `fs` in Hz, forward and backward, then differentiation.

    At frequencies in Hz, shape (n,); in 1/s^derivative.
    """
    behind = low_pass(frequency_hz, choice.cutoff_hz, choice.filter_order, fs)
    return np.asarray(behind * (2.0 * pi * frequency_hz) ** derivative)


@dataclass(frozen=True, eq=False)
class NoiseBand:
    """Frequencies in Hz, and the filter's gain in power times a line's width in Hz: shape (lines,) each."""

    frequency_hz: FloatArray
    power: FloatArray
    _moments: dict[int, float] = field(default_factory=dict, repr=False)

    def moment(self, order: int) -> float:
        """Return the sum of the power times that power of the circular frequency, worked out once."""
        if order not in self._moments:
            omega = 2.0 * np.pi * self.frequency_hz
            self._moments[order] = float(integer_power(omega, order) @ self.power)
        return self._moments[order]


def noise_band(record: Record, choice: FilterChoice) -> NoiseBand:
    """Return the band that noise of a record's readings has behind the filter, in `NOISE_LINES` lines."""

    def make() -> NoiseBand:
        top_hz = min(0.5 * record.fs, HIGHEST * choice.cutoff_hz)
        frequency_hz = top_hz * (np.arange(NOISE_LINES) + 0.5) / NOISE_LINES
        power = gain(frequency_hz, choice, 0, record.fs) ** 2 * top_hz / NOISE_LINES
        return NoiseBand(frequency_hz, power)

    return record.facts.kept(("noise band", choice), make)


def _entry(record: Record, channel: str, signal: Signal, choice: FilterChoice) -> SignalToNoise:
    spectrum = record.facts.spectrum(channel)
    frequency_hz, density = spectrum.frequency_hz, spectrum.density
    step = float(frequency_hz[1] - frequency_hz[0])
    squared = gain(frequency_hz, choice, signal.derivative, record.fs) ** 2
    power = float(np.sum(squared * density) * step)
    noise = float(spectrum.noise * np.sum(squared) * step)
    visible = spectrum.visible_to_hz(signal.derivative)
    ratio = power / noise - 1.0 if noise > 0.0 else inf
    snr = 10.0 * log10(ratio) if 0.0 < ratio < inf else None
    return SignalToNoise(
        record.name, channel, signal.derivative, signal.unit, sqrt(power), sqrt(noise), snr, visible
    )
