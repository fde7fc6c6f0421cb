"""Up to which frequency speeds show when a body reverses: as far as noise changes them little meanwhile.

A speed bends where friction jumps, and a low-pass of it turns late; noise behind a wide one turns by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np

from modelgen.runtime.filter_choice.thresholds import HIGHEST_CUTOFF, TURNS_CLEARLY
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def turning_band_hz(acceleration: float, noise: float, derivative: int, fs: float) -> float:
    """Return the band in Hz in which noise changes a speed by a small share of what turning does in its time.

    Parameters
    ----------
    acceleration : float
        Of what turns, in SI.
    noise : float
        Density of the reading's white noise, unit^2/Hz.
    derivative : int
        How often the reading is differentiated to be a speed.
    fs : float
        Hz; a share of it is the most.
    """
    # rms of the speed's noise below f is sqrt(noise) (2 pi)^m f^(m + 1/2) / sqrt(2 m + 1)
    m = derivative
    least = sqrt(noise) * (2.0 * pi) ** (m + 1) / sqrt(2.0 * m + 1.0)
    ratio = TURNS_CLEARLY * acceleration / max(least, float(np.finfo(float).tiny))
    return min(float(ratio ** (1.0 / (m + 1.5))), HIGHEST_CUTOFF * fs)


def direction_cutoff(
    model: Model, records: Sequence[Record], cutoff_hz: float, dynamics_hz: float | None
) -> float:
    """Return the cut-off in Hz of velocities whose signs are directions, from that of the rows and dynamics.

    Of arms it is the band in which all sensed speeds show when they reverse: joints turn as fast as friction
    lets them. Where springs give some of the speeds it is that of the rows, as these hold far more noise.
    What of a chain's velocities is beyond the dynamics is not known to be motion.
    """
    if not model.is_arm:
        return min(dynamics_hz or cutoff_hz, cutoff_hz)
    if isinstance(model.kernel, DeflectedKernel) and model.kernel.speeds:
        return cutoff_hz
    found, keys = [], frozenset(model.direction_keys)
    for signal in model.signals:
        if signal.key not in keys or (signal.sensor is None and signal.actuator is None):
            continue
        for record in records:
            spectrum = record.facts.spectrum(signal.channel)
            moving = spectrum.signal(signal.derivative + 1)[spectrum.frequency_hz < cutoff_hz]
            size = sqrt(float(moving.sum()) * float(spectrum.frequency_hz[0]))
            found.append(turning_band_hz(size, spectrum.noise, signal.derivative, record.fs))
    return max(cutoff_hz, min(found, default=0.0))
