"""Effects that a model or its sensors may lack, each as a small change of what a simulation reads.

An effect is known by what it adds to the channels per unit of its size: a late sensor reads -s'(t), a force
on a body moves the chain. Rows are evaluated on readings with and without it; the difference is how their
mismatch Y - W X grows with the size. That holds for any sensor set, and without a row knowing of the effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.iv.chain_errors import chain_effects
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect, curvature
from modelgen.runtime.iv.thresholds import KEPT, LAGS, RESOLVED, SHORTEST_REACH
from modelgen.runtime.least_squares.delays import shift
from modelgen.runtime.model.model import Model, Sensor
from modelgen.runtime.records.channels import Edit


def effects_of(model: Model, bodies: Sequence[str], records: int) -> tuple[Effect, ...]:
    """Return the effects that are looked for: of sensors, of forces, of bodies and of links."""
    found: list[Effect] = []
    for sensor in model.sensors:
        found += _sensor_effects(sensor, records)
    for actuator in model.actuators:
        found += _force_effects(actuator.key)
    found += chain_effects(model, bodies)
    return tuple(found)


def zero_effects(model: Model, records: int) -> tuple[Effect, ...]:
    """Return the zeros of all positions but the first one, in every record: only differences are seen."""
    keys = [sensor.key for sensor in model.sensors if sensor.measures == "position" and sensor.body]
    return tuple(zero_effect(key, index, records) for key in keys[1:] for index in range(records))


def zero_effect(key: str, index: int, records: int) -> Effect:
    """Return the zero of a sensor in one of so many records."""
    where = f" in record {index + 1}" if records > 1 else ""
    zero = f"{key} has a zero of its own{where}"
    remedy = "subtract its reading at rest"
    return Effect(
        f"zero of {key}{where}", "zero", zero, zero, remedy, _constant(key, index), key, record=index
    )


def delay_effects(model: Model) -> tuple[Effect, ...]:
    """Return the delay of each sensor, the first one's included: only differences are seen."""
    return tuple(_delay(sensor.key) for sensor in model.sensors if sensor.key in model.channels)


def _delay(key: str) -> Effect:
    late = _with(key, lambda s, dt: -np.gradient(s, dt))
    remedy = "read all channels at one instant, or shift this one"
    words, early = f"{key} is late", f"{key} is early"
    return Effect(f"delay of {key}", "delay", words, early, remedy, late, key, _on_time)


def _sensor_effects(sensor: Sensor, records: int) -> Iterator[Effect]:
    key = sensor.key
    yield _delay(key)
    yield Effect(f"bandwidth of {key}", "lag", f"{key} is read through a low-pass of its own",
                 f"another channel is read through a low-pass that {key} has not",
                 "give all channels the same filter", _with(key, curvature), key, _without_lag)  # fmt: skip
    clock = f"{key} has a clock of its own"
    yield Effect(f"clock of {key}", "clock", clock, clock, "read all channels with one clock",
                 _with(key, _stretched))  # fmt: skip
    gain = f"the gain of {key} is off"
    yield Effect(f"gain of {key}", "gain", gain, gain, "calibrate it", _with(key, lambda s, dt: s))
    for index in range(records):
        yield zero_effect(key, index, records)


def _force_effects(key: str) -> Iterator[Effect]:
    yield Effect(f"lag of {key}", "lag", f"{key} is read through a low-pass",
                 f"{key} acts behind a lag (a current loop) or is held over a sample",
                 "record the force that acts", _with(key, curvature), key, _without_lag)  # fmt: skip
    clock = f"{key} has a clock of its own"
    yield Effect(f"clock of {key}", "clock", clock, clock, "read all channels with one clock",
                 _with(key, _stretched))  # fmt: skip


def _on_time(key: str, size: float, fs: float) -> Edit:
    return shift(key, size * fs)


def _without_lag(key: str, size: float, fs: float) -> Edit:
    """Return what undoes 1 + size s^2 as a lag has it: e^(tau s) / (1 + tau s), tau = sqrt(-2 size).

    A force that acts behind a lag is its command through that low-pass; the delay is looked for apart. A
    positive size is that of a low-pass in the reading, which is undone.
    """
    tau = float(np.sqrt(2.0 * abs(size))) * fs
    reach = int(np.ceil(LAGS * tau)) + SHORTEST_REACH
    # sampled so finely that the response does not wrap around
    count = quick_length(RESOLVED * reach)
    frequency = np.fft.rfftfreq(count)
    phase = 2.0j * np.pi * frequency * tau
    response = np.exp(phase) / (1.0 + phase)
    # no step at half the sampling frequency, or the weights would hardly die away
    kept = np.cos(0.5 * np.pi * np.clip((frequency - KEPT) / (0.5 - KEPT), 0.0, 1.0)) ** 2
    weights = np.fft.irfft(1.0 + kept * ((response if size < 0.0 else 1.0 / response) - 1.0), count)
    weights = np.r_[weights[-reach:], weights[: reach + 1]]
    return Edit(key, lambda samples: np.convolve(samples, weights / weights.sum(), "valid"), reach)


def _with(key: str, change: Callable[[FloatArray, float], FloatArray]) -> Callable[[Simulated], Changes]:
    return lambda simulated: {key: change(simulated.record.signals[key], simulated.record.dt)}


def _constant(key: str, index: int) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        return {key: np.ones(simulated.record.n)} if simulated.index == index else {}

    return changes


def _stretched(samples: FloatArray, dt: float) -> FloatArray:
    """Return t s'(t): what a clock that runs slow adds; t from the middle, as delays are looked for apart."""
    t = dt * (np.arange(len(samples)) - 0.5 * len(samples))
    return np.asarray(t * np.gradient(samples, dt))
