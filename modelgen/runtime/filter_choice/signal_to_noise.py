"""Signal against noise: every derivative the rows need, behind the filter, and its channel's own noise.

The noise of a reading is taken as white, at the level of the uppermost fifth of its band. Differentiating
multiplies it by the frequency, so that each derivative needs a motion that is larger by as much; the table
says up to where every derivative stands out, and what is left of it at the cut-off in use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log10, pi, sqrt

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.noise_spectrum import low_pass
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
