"""Multisine with a low crest: much power within a given peak."""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.simulation.thresholds import CLIPS, CREST_ROUNDS, POINTS_A_WAVE


def multisine(
    t: FloatArray, low_hz: float, high_hz: float, tilt: float = 0.0, spacing_hz: float = 4.0
) -> FloatArray:
    """Return a multisine of peak 1 at the times t in s, shape (n,).

    Parameters
    ----------
    t : ndarray, shape (n,)
    low_hz, high_hz : float
        Band in Hz; it is rounded to the lines, at least one.
    tilt : float
        Amplitudes are proportional to frequency to the power of -tilt.
    spacing_hz : float
        Lines lie at its multiples; it is the inverse of the period.
    """
    first = max(1, round(low_hz / spacing_hz))
    numbers = tuple(range(first, max(first, round(high_hz / spacing_hz)) + 1))
    amplitudes, phases = _lines(numbers, round(tilt, 6))
    wave = np.zeros(t.size)
    for number, amplitude, phase in zip(numbers, amplitudes, phases, strict=True):
        wave += amplitude * np.cos(2.0 * pi * number * spacing_hz * t + phase)
    return wave


@lru_cache(maxsize=256)
def _lines(numbers: tuple[int, ...], tilt: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return amplitudes and phases of peak 1, by clipping from Schroeder's phases.

    Van der Ouderaa, Schoukens, Renneboog 1988: clip the wave, keep the phases of what is left, repeat.
    """
    lines = np.array(numbers)
    amplitudes = (lines / lines[0]) ** -tilt
    power = amplitudes**2 / (amplitudes**2).sum()
    # Schroeder 1970: phases from the power below each line
    phases = -2.0 * pi * np.cumsum(np.cumsum(power) - power)
    size = POINTS_A_WAVE * (numbers[-1] + 1)
    best = (np.inf, phases)
    for k in range(CREST_ROUNDS):
        spectrum = np.zeros(size // 2 + 1, dtype=complex)
        spectrum[lines] = amplitudes * np.exp(1j * phases)
        wave = np.fft.irfft(spectrum, size) * size / 2.0
        peak = float(np.abs(wave).max())
        if peak < best[0]:
            best = (peak, phases)
        clip = (CLIPS[0] + (CLIPS[1] - CLIPS[0]) * k / CREST_ROUNDS) * peak
        phases = np.angle(np.fft.rfft(np.clip(wave, -clip, clip))[lines])
    return tuple((amplitudes / best[0]).tolist()), tuple(best[1].tolist())
