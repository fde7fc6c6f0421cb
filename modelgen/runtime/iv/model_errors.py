"""Effects that a model or its sensors may lack, each as a small change of what a simulation reads.

An effect is known by what it adds to the channels per unit of its size: a late sensor reads -s'(t), a force
on a body moves the chain. Rows are evaluated on readings with and without it; the difference is how their
mismatch Y - W X grows with the size. That holds for any sensor set, and without a row knowing of the effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.chain_errors import chain_effects
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.low_pass import high_pass, low_pass, two_poles
from modelgen.runtime.iv.thresholds import LONGEST_LIMIT, SATURATED
from modelgen.runtime.iv.varying_parameters import courses, falling_gain, varying_along, varying_effects
from modelgen.runtime.least_squares.time_shifts import on_one_clock, shift
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record


def effects_of(
    model: Model,
    bodies: Sequence[str],
    records: Sequence[Record],
    late: Sequence[str] = (),
    turning: bool = True,
) -> tuple[Effect, ...]:
    """Return the effects that are looked for: of sensors, of forces, of bodies and of links.

    Those of one name are one at several settings: what explains most of them counts. `records` are as
    measured; `late` are forces whose delay is not estimated otherwise; `turning` says whether samples about
    reversals are used.
    """
    found: list[Effect] = []
    level, ways = _read_with_their_level(model), courses(records)
    varying = [varying_along(course, model.parameters) for course in ways]
    for sensor in model.sensors:
        found += _sensor_effects(sensor, len(records) if sensor.key in level else 0)
    for actuator in model.actuators:
        key = actuator.key
        peaks = [record.facts.extent(key).peak for record in records if key in record.signals]
        found += _force_effects(key, key in late, max(peaks, default=0.0))
        found += [falling_gain(key, *one) for one in zip(ways, varying, strict=True)]
    if not model.cubic_springs:  # such a chain is not linear
        found += (*chain_effects(model, bodies, turning), *varying_effects(model, records))
    return tuple(found)


def zero_effects(model: Model, records: int) -> tuple[Effect, ...]:
    """Return the zeros of all positions but the first one, in every record: only differences are seen."""
    keys = [sensor.key for sensor in model.sensors if sensor.measures == "position" and sensor.body]
    level = _read_with_their_level(model)
    keys = [key for key in keys if key in level]
    return tuple(zero_effect(key, index, records) for key in keys[1:] for index in range(records))


def _read_with_their_level(model: Model) -> frozenset[str | None]:
    """Return the sensors that a row reads undifferentiated: what a zero does to the others is rounding."""
    return frozenset(signal.sensor for signal in model.signals if signal.derivative == 0)


def zero_effect(key: str, index: int | None, records: int) -> Effect:
    """Return the zero of a sensor in one of so many records, or the same in all of them."""
    where = f" in record {index + 1}" if records > 1 and index is not None else ""
    zero = f"{key} has a zero of its own{where}"
    remedy = "subtract its reading at rest"
    constant = _constant(key, index)
    return Effect(f"zero of {key}{where}", "zero", zero, zero, remedy, constant, key, _less, record=index)


def delay_effects(model: Model) -> tuple[Effect, ...]:
    """Return the delay of each sensor, the first one's included: only differences are seen."""
    return tuple(delay_effect(sensor.key) for sensor in model.sensors if sensor.key in model.channels)


def clock_effects(model: Model) -> tuple[Effect, ...]:
    """Return the clocks of all sensors but the first one, and of all forces."""
    sensors = [sensor.key for sensor in model.sensors if sensor.key in model.channels]
    forces = [actuator.key for actuator in model.actuators]
    return tuple(_clock(key) for key in (*sensors[1:], *forces))


def delay_effect(key: str) -> Effect:
    """Return that a channel, a sensor or a force, is read late."""
    late = _with(key, lambda s, dt: -np.gradient(s, dt))
    remedy = "read all channels at one instant, or shift this one"
    words, early = f"{key} is late", f"{key} is early"
    return Effect(f"delay of {key}", "delay", words, early, remedy, late, key, _on_time)


def _clock(key: str) -> Effect:
    """Return that a channel has a clock of its own, a slow one where the size is positive.

    First readings are taken together; where they are not, the channel is late as well.
    """
    words, remedy = f"{key} has a clock of its own", "read all channels with one clock"
    slow = _with(key, lambda s, dt: dt * np.arange(len(s)) * np.gradient(s, dt))
    return Effect(f"clock of {key}", "clock", words, words, remedy, slow, key, on_one_clock)


def _sensor_effects(sensor: Sensor, records: int) -> Iterator[Effect]:
    """Yield the effects of a sensor, its zero in each of so many records."""
    key = sensor.key
    yield replace(delay_effect(key), alike=(two_poles(key),))
    yield low_pass(key, force=False)
    if sensor.measures == "acceleration":
        yield high_pass(key)
    yield _clock(key)
    gain = f"the gain of {key} is off"
    yield Effect(
        f"gain of {key}", "gain", gain, gain, "calibrate it", _with(key, lambda s, dt: s), key, _true
    )
    if records > 1:
        yield zero_effect(key, None, records)
    for index in range(records):
        yield zero_effect(key, index, records)


def _force_effects(key: str, late: bool, peak: float) -> Iterator[Effect]:
    """Yield the effects of a force whose largest reading is `peak`."""
    if late:
        yield delay_effect(key)
    yield low_pass(key, force=True)
    yield _clock(key)
    if peak > 0.0:
        yield from (_saturation(key, share * peak, peak) for share in SATURATED)
        yield from _force_curves(key, peak)


def _force_curves(key: str, peak: float) -> Iterator[Effect]:
    """Yield that a force acts by a constant less than is recorded, or by its cube less, or more.

    A drive has a dead zone, or a current's zero crossing is distorted; a torque constant falls with the
    current, as iron saturates. Friction and inertia would take either over.
    """
    curves: dict[str, tuple[str, str, Callable[[FloatArray], FloatArray]]] = {
        "dead zone": (
            f"{key} acts by a constant less than is recorded, on either side of zero: a dead zone",
            "",  # no drive adds a constant to what it is told; an inertia that changes looks like that
            np.sign,
        ),
        "curve": (
            f"the gain of {key} falls with its size: the larger it is, the less acts",
            f"the gain of {key} rises with its size: the larger it is, the more acts",
            lambda signal: signal * (signal / peak) ** 2,
        ),
    }
    remedy = "measure how the force grows with its command, or compare amplitudes"
    for name, (less, more, curve) in curves.items():
        yield Effect(f"{name} of {key}", "form", less, more, remedy, _curved(key, curve), key)


def _saturation(key: str, limit: float, peak: float) -> Effect:
    """Return that less of a force acts beyond a limit than is recorded; the size is the share that does not.

    A command is recorded, and the drive's current has a limit, or its iron saturates.
    """

    def beyond(signal: FloatArray, dt: float) -> FloatArray:
        return signal - np.clip(signal, -limit, limit)

    def at_limit(signal: FloatArray, dt: float) -> FloatArray:
        return np.sign(signal) * (np.abs(signal) > limit)

    def moved(size: float, steps: Sequence[float]) -> Effect:
        step = -steps[0] / size if size else 0.0
        reach = -LONGEST_LIMIT * limit, LONGEST_LIMIT * (peak - limit)
        return _saturation(key, limit + float(np.clip(step, *reach)), peak)

    name = f"saturation of {key}"
    words = f"{key} acts no further, or less, beyond {limit:.3g}: the drive does not follow its command there"
    remedy = "record the force (the current) that acts, or command less"
    shape = Effect(f"limit of {key}", "saturation", "", "", "", _with(key, at_limit), key)
    return Effect(name, "saturation", words, "", remedy, _with(key, beyond), key,
                  shape=lambda records: (shape,), moved=moved)  # fmt: skip


def _on_time(key: str, size: float, record: Record) -> Edit:
    return shift(key, size * record.fs)


def _less(key: str, size: float, record: Record) -> Edit:
    return Edit(key, lambda samples, start: samples - size)


def _true(key: str, size: float, record: Record) -> Edit:
    return Edit(key, lambda samples, start: samples / (1.0 + size))


def _with(key: str, change: Callable[[FloatArray, float], FloatArray]) -> Callable[[Simulated], Changes]:
    return lambda simulated: {key: change(simulated.record.signals[key], simulated.record.dt)}


def _curved(key: str, curve: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    return _with(key, lambda signal, dt: curve(signal))


def _constant(key: str, index: int | None) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        return {key: np.ones(simulated.record.n)} if index in (None, simulated.index) else {}

    return changes
