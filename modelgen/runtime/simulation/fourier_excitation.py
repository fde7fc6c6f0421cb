"""A record at a few speeds, with a Fourier series of the rate and a multisine of the force; and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np

from modelgen.errors import DataError, Problem
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.simulation.closed_loop import bandwidth_hz, vibration
from modelgen.runtime.simulation.excitation import Excitation, integral, raised_cosine
from modelgen.runtime.simulation.multisine import multisine
from modelgen.runtime.simulation.plant import Plant
from modelgen.runtime.simulation.thresholds import PIECES_A_SAMPLE, RAMP_PERIODS, RAMP_RANGE


@dataclass(frozen=True)
class Shape:
    """One record: speeds in proportion to one another, the multisine in shares of the force limit.

    The record is divided by `times` (shares); every part has a speed and an amplitude of the multisine. To
    the speeds are added sines and cosines of 1, 2, ... periods a record. Amplitudes of the multisine's lines
    are proportional to frequency to the power of -tilt.
    """

    speeds: tuple[float, ...]
    times: tuple[float, ...]
    forces: tuple[float, ...]
    sines: tuple[float, ...]
    cosines: tuple[float, ...]
    low_hz: float
    high_hz: float
    tilt: float


def write_references(
    path: Path, excitations: Sequence[Excitation], fs: float, *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Write every excitation at the sampling frequency (Hz), for a controller to play.

    Columns are reference, reference_rate and feedforward (SI); NAME.csv becomes NAME_1.csv, NAME_2.csv.
    """
    paths = tuple(path.with_stem(f"{path.stem}_{i}") for i in range(1, len(excitations) + 1))
    taken = [p for p in paths if p.exists()]
    if taken and not overwrite:
        remedy = "choose another name, or replace it (--overwrite; overwrite=True)"
        raise DataError(*(Problem(str(p), "exists already", remedy) for p in taken))
    for target, excitation in zip(paths, excitations, strict=True):
        stride = round(excitation.rate_hz / fs)
        columns = {
            key: getattr(excitation, key)[::stride] for key in ("reference", "reference_rate", "feedforward")
        }
        write_record(target, Record(columns, fs, target.stem), overwrite=overwrite)
    return paths


def series_excitation(
    shape: Shape,
    plant: Plant,
    limits: Mapping[str, float],
    scale: tuple[float, float],
    fs: float,
    duration_s: float,
) -> Excitation:
    """Return the excitation of a shape, its rate and its multisine scaled as a whole each."""
    t = np.arange((round(duration_s * fs) - 1) * PIECES_A_SAMPLE + 1) / (fs * PIECES_A_SAMPLE)
    modes = vibration(plant)
    ramp_s = min(RAMP_PERIODS / bandwidth_hz(modes), 0.25 * min(shape.times) * duration_s)
    # a ramp is as long as it is high, so that a reversal needs no more force than a start
    fastest = max(map(abs, shape.speeds)) or 1.0
    steps = np.diff([0.0, *shape.speeds, 0.0])
    ramps = ramp_s * np.clip(np.abs(steps) / fastest, *RAMP_RANGE)
    middles = t[-1] * np.cumsum([0.0, *shape.times])
    middles[0], middles[-1] = 0.5 * ramps[0], t[-1] - 0.5 * ramps[-1]
    rate, amplitude = np.zeros(t.size), np.zeros(t.size)
    for step, middle, ramp in zip(steps, middles, ramps, strict=True):
        rate += step * raised_cosine((t - middle) / ramp + 0.5)
    for k, force in enumerate(shape.forces):
        # the multisine waits until the speed is reached
        begun = raised_cosine((t - middles[k]) / ramps[k] - 0.5)
        amplitude += force * begun * raised_cosine((middles[k + 1] - t) / ramps[k + 1] - 0.5)
    window = raised_cosine(t / ramp_s) * raised_cosine((t[-1] - t) / ramp_s)
    for k, (a, b) in enumerate(zip(shape.sines, shape.cosines, strict=True), start=1):
        rate += window * (a * np.sin(2.0 * pi * k * t / t[-1]) + b * np.cos(2.0 * pi * k * t / t[-1]))
    # in speeds of the driven body: the limit holds for the fastest one
    rate *= scale[0] * limits["velocity"] / float(np.abs(modes.lowest).max())
    force_wave = (
        scale[1] * limits["force"] * amplitude * multisine(t, shape.low_hz, shape.high_hz, shape.tilt)
    )
    return Excitation(integral(rate, t), rate, force_wave, fs * PIECES_A_SAMPLE, "series")
