"""What is periodic in the position of a body: a force on it (cogging, teeth), or an error of its encoder.

The size is the amplitude; how many radians of it pass per radian or metre of the body, and its phase in each
record, where positions may have other zeros, are its shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import RIPPLE, Changes, Effect
from modelgen.runtime.iv.held_motion import nearest_sensor
from modelgen.runtime.iv.pushed_chain import pushed_body
from modelgen.runtime.iv.thresholds import FEWEST_PERIODS, LED_ORDER, LONGEST_PHASE
from modelgen.runtime.model.model import Model


@dataclass(frozen=True)
class PeriodicPlace:
    """What is periodic in the position of a body: a force on it, or what the position sensor `key` reads."""

    body: str
    key: str = ""

    @property
    def name(self) -> str:
        """Name of the effect."""
        return f"periodic error of {self.key}" if self.key else f"ripple on {self.body}"

    def changes(self, simulated: Simulated, samples: FloatArray) -> Changes:
        """Return what samples of it, in N m, N, rad or m, shape (n,), change in the channels."""
        return {self.key: samples} if self.key else pushed_body(simulated, self.body, samples)


def places_of(model: Model, bodies: Sequence[str]) -> tuple[PeriodicPlace, ...]:
    """Return all places of a model."""
    read = [
        one for one in model.sensors if one.measures == "position" and one.body and one.key in model.channels
    ]
    return (*map(PeriodicPlace, bodies), *(PeriodicPlace(one.body or "", one.key or "") for one in read))


def ripple(model: Model, at: PeriodicPlace, way: float, number: float, phases: Sequence[float]) -> Effect:
    """Return what is a sine of a position at a place, in radians per rad or m.

    `way` is the longest that the body goes in a record, in rad or m; `phases` are those in its middle, by
    record, in rad.
    """

    def part(
        name: str, form: Callable[[FloatArray, FloatArray], FloatArray], record: int | None = None
    ) -> Effect:
        return replace(wave(at, number, phases, form, record), name=f"{name} of a {at.name}")

    def shape(records: int) -> tuple[Effect, ...]:
        return (
            part("number", lambda p, phase: p * np.cos(phase)),
            *(
                part(f"phase in record {index + 1}", lambda _, phase: np.cos(phase), index)
                for index in range(records)
            ),
        )

    def moved(size: float, steps: Sequence[float]) -> Effect:
        if not size:
            return ripple(model, at, way, number, phases)
        by = np.asarray(steps) / size
        # at the ends of the way a step of the number is one of phase
        longest = np.r_[min(2.0 * LONGEST_PHASE / way, 0.5 * number), np.full(len(phases), LONGEST_PHASE)]
        steps_taken = np.clip(by, -longest, longest)
        slowest = 2.0 * np.pi * FEWEST_PERIODS / way
        further = max(number + float(steps_taken[0]), slowest)
        return ripple(model, at, way, further, (phases + steps_taken[1:]).tolist())

    period = _period(model, at.body, number)
    words = f"a force that varies with the position of {at.body} acts on it, {period}"
    remedy = "compensate it in the drive (cogging, ripple of the force), or move over more of its periods"
    if at.key:
        words = f"{at.key} has an error that is periodic in what it reads, {period}"
        remedy = "calibrate it over a period (an eccentric scale, a resolver), or move over more of them"
    return replace(
        wave(at, number, phases, lambda _, phase: np.sin(phase)),
        name=at.name,
        words=words,
        remedy=remedy,
        shape=shape,
        moved=moved,
        elsewhere=lambda records: waves(at, number, records),
    )


def waves(at: PeriodicPlace, number: float, records: int) -> tuple[Effect, ...]:
    """Return a sine and a cosine of so many radians per rad or m in each of so many records."""
    zero = [0.0] * records
    return tuple(
        replace(wave(at, number, zero, form, index), name=f"{name} of a {at.name} in record {index + 1}")
        for index in range(records)
        for name, form in (
            ("sine", lambda _, phase: np.sin(phase)),
            ("cosine", lambda _, phase: np.cos(phase)),
        )
    )


def wave(
    at: PeriodicPlace,
    number: float,
    phases: Sequence[float],
    form: Callable[[FloatArray, FloatArray], FloatArray],
    record: int | None = None,
) -> Effect:
    """Return what is a function of a position, from the middle, and of a wave's phase there.

    `form` takes both, in rad or m and in rad, shape (n,) each, to the force in N m or N, or the error in rad
    or m, shape (n,).
    """

    def changes(simulated: Simulated) -> Changes:
        if record not in (None, simulated.index):
            return {}
        place = position(simulated, at.body)
        return at.changes(simulated, form(place, number * place + phases[simulated.index]))

    return Effect(at.name, RIPPLE, "", "", "", changes, record=record)


def position(simulated: Simulated, body: str) -> FloatArray:
    """Return the position of a body in the measured record, from its middle, in rad or m, shape (n,).

    The simulated one, led by the sensor that shows its slow motion best; not to be changed.
    """
    key = "position", body
    if key not in simulated.places:
        simulated.places[key] = _position(simulated, body)
    return simulated.places[key]


def _position(simulated: Simulated, body: str) -> FloatArray:
    own, record = simulated.motion[f"q_{body}"], simulated.measured
    if record is not None:
        sensor, gear = nearest_sensor(simulated.plant, body, record)
        away = record.signals[sensor.key] - simulated.record.signals[sensor.key]
        if sensor.order == 1:
            away = np.cumsum(away) * record.dt
        if sensor.order < 2:
            own = own + gear * zero_phase(away, LED_ORDER, simulated.led_hz, record.fs)
    return np.asarray(own - 0.5 * (np.min(own) + np.max(own)))


def _period(model: Model, body: str, number: float) -> str:
    inertia = next(
        (name for name, role in model.roles.items() if role.role == "inertia" and role.bodies == (body,)), ""
    )
    if model.units.get(inertia) == "kg":
        return f"with a period of {2.0 * np.pi / number:.4g} m"
    return f"{number:.4g} periods a turn"
