"""Readings of instruments: the true signal with a bias, white noise, then rounded to the resolution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from zlib import crc32

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.keyword_options import check_seed
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.directions import wanted_directions
from modelgen.runtime.records.record import missing_name


def instrument_keys(model: Model) -> tuple[str, ...]:
    """Return the channels that come from an instrument: sensors, then actuators."""
    sensors = tuple(sensor.key for sensor in model.sensors)
    return sensors + tuple(actuator.key for actuator in model.actuators)


Levels = Mapping[str, float]


def checked_levels(
    keys: Sequence[str], noise: Levels | None, resolution: Levels | None, bias: Levels | None, seed: int
) -> tuple[Levels, Levels, Levels]:
    """Return noise, resolution and bias; DataError for one of no key, one out of range, a seed below zero."""
    for option, given in (("noise", noise), ("resolution", resolution), ("bias", bias)):
        lowest, remedy = 0.0, "give zero or a positive number"
        if option == "bias":
            lowest, remedy = -np.inf, "give a finite number"
        levels = given or {}
        problems = [missing_name(option, "channel", key, keys) for key in levels if key not in keys]
        problems += [
            Problem(f"{option}: {key}", f"is {level!r}", remedy)
            for key, level in levels.items()
            if not (lowest <= level < np.inf and level > -np.inf)
        ]
        DataError.raise_any(problems)
    check_seed(seed)
    return dict(noise or {}), dict(resolution or {}), dict(bias or {})


def readings(
    model: Model,
    true: Mapping[str, FloatArray],
    noise: Mapping[str, float],
    resolution: Mapping[str, float],
    seed: int,
    bias: Mapping[str, float] | None = None,
    motion: str = "",
) -> dict[str, FloatArray]:
    """Return what the instruments read, and the directions of motion that the model needs.

    Signals have shape (N,), in SI.
    """
    measured = drawn(instrument_keys(model), true, noise, resolution, seed, bias, motion)
    return measured | {key: true[key] for key in wanted_directions(model)}


def drawn(
    keys: Sequence[str],
    true: Mapping[str, FloatArray],
    noise: Mapping[str, float],
    resolution: Mapping[str, float],
    seed: int,
    bias: Mapping[str, float] | None = None,
    motion: str = "",
) -> dict[str, FloatArray]:
    """Return what instruments of these channels read, shape (N,) each, in SI.

    Every instrument draws its noise from a stream of its own: another channel's noise does not change it.
    Records of one seed share no noise where their `motion` (a name) or their length differs.
    """
    entropy = [seed, crc32(motion.encode()), len(next(iter(true.values())))]
    streams = np.random.default_rng(entropy).spawn(len(keys))
    measured = {}
    for key, stream in zip(keys, streams, strict=True):
        reading = true[key]
        if bias and bias.get(key):
            reading = reading + bias[key]
        if noise.get(key):
            reading = reading + noise[key] * stream.standard_normal(reading.size)
        if resolution.get(key):
            reading = resolution[key] * np.round(reading / resolution[key])
        measured[key] = reading
    return measured
