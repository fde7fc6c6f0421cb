"""Peaks of measured frequency responses to compare modes with: what records show without the model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import ModelgenError
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.modes import Mode, Modes, Peak
from modelgen.runtime.modes.thresholds import (
    EXCITED,
    LEAST_COHERENCE,
    LONGEST_RECORD,
    MOST_PEAK_RECORDS,
    PEAK_DAMPING,
    PEAK_RANGE,
    PEAK_RISE,
    VALLEY_RANGE,
)
from modelgen.runtime.records.record import Record


def with_peaks(modes: Modes, model: Model, records: Sequence[Record]) -> Modes:
    """Return modes with the peak nearest to each, where a record shows one; a peak belongs to one mode."""
    swings = [(mode, _swing_hz(mode)) for mode in modes]
    wanted = [(mode, hertz) for mode, hertz in swings if hertz is not None]
    if not wanted:
        return modes
    nearest: dict[int, Peak] = {}
    for peak in _peaks(model, records):
        away = [abs(np.log(peak.frequency_hz / hertz)) for _, hertz in wanted]
        k = int(np.argmin(away))
        # a higher peak above the valleys next to it shows more
        higher = k not in nearest or peak.rise > nearest[k].rise
        if away[k] < np.log(PEAK_RANGE) and higher:
            nearest[k] = peak
    found = {id(wanted[k][0]): peak for k, peak in nearest.items()}
    return replace(modes, modes=tuple(replace(one, measured=found.get(id(one))) for one in modes))


def _swing_hz(mode: Mode) -> float | None:
    """Return the frequency in Hz of a mode that may show a peak; None for one that hardly swings."""
    frequency, damping = mode.frequency_hz, mode.damping_ratio
    if frequency is None or damping is None or abs(damping.value) >= PEAK_DAMPING:
        return None
    return frequency.value


def _peaks(model: Model, records: Sequence[Record]) -> Iterator[Peak]:
    for record in [one for one in records if one.n <= LONGEST_RECORD][:MOST_PEAK_RECORDS]:
        forces = [entry.key for entry in model.actuators if entry.key in record.signals]
        sensors = [entry for entry in model.sensors if entry.key in record.signals]
        for force in forces:
            for sensor in sensors:
                try:
                    yield from _peaks_of(record, sensor, force)
                except ModelgenError:  # a force that does not move has no response
                    continue


def _peaks_of(record: Record, sensor: Sensor, force: str) -> Iterator[Peak]:
    """Yield the peaks of the response as an acceleration: it is flat next to them."""
    found = record.frequency_response(sensor.key, force)
    f = found.frequency_hz
    if f.size < 3:
        return
    size = np.abs(found.response) * f ** (2 - sensor.order)
    inner = size[1:-1]
    tops = 1 + np.flatnonzero((inner > size[:-2]) & (inner >= size[2:]) & (inner > 0.0))
    for top in tops[found.coherence[tops] >= LEAST_COHERENCE].tolist():
        near = np.flatnonzero((f > f[top] / PEAK_RANGE) & (f < f[top] * PEAK_RANGE))
        wide = np.flatnonzero((f > f[top] / VALLEY_RANGE) & (f < f[top] * VALLEY_RANGE))
        valley = max(float(size[wide[0] : top + 1].min()), float(size[top : wide[-1] + 1].min()))
        if size[top] < float(size[near].max()) or size[top] < PEAK_RISE * valley:
            continue
        if not _excited(record, force, f[top] / PEAK_RANGE, f[top] * PEAK_RANGE):
            continue
        resolution = float(f[top + 1] - f[top - 1]) / 2.0
        yield Peak(
            _refined(f, size, top),
            resolution,
            float(size[top] / max(valley, np.finfo(float).tiny)),
            record.name,
            sensor.key,
            force,
        )


def _excited(record: Record, force: str, low_hz: float, high_hz: float) -> bool:
    """Return whether the force has power between two frequencies: what leaks there makes peaks of its own."""
    f, power = record.facts.power(force)
    bands = np.r_[low_hz * (high_hz / low_hz) ** np.arange(-40.0, 41.0)]
    edges = np.unique(np.searchsorted(f, bands[bands < f[-1]]))
    if edges.size < 2:
        return False
    density = np.diff(np.r_[0.0, np.cumsum(power)][edges]) / np.diff(edges)
    own = power[(f >= low_hz) & (f < high_hz)]
    return bool(own.size and own.mean() >= EXCITED * density.max())


def _refined(f: FloatArray, size: FloatArray, top: int) -> float:
    """Return the top of the parabola through the logarithms of three lines."""
    places, heights = f[top - 1 : top + 2] - f[top], np.log(np.maximum(size[top - 1 : top + 2], 1e-300))
    curve = np.polyfit(places, heights, 2)
    if not curve[0] < 0.0:
        return float(f[top])
    return float(f[top] + np.clip(-0.5 * curve[1] / curve[0], places[0], places[2]))
