"""A force that is periodic in the position of a body, as of cogging, a drive's ripple or a gear's teeth.

Its size is the amplitude; how many radians of it pass per radian or metre of the body, and its phase in each
record, where positions may have other zeros, are its shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import RIPPLE, Changes, Effect
from modelgen.runtime.iv.held_motion import nearest_sensor
from modelgen.runtime.iv.pushed_chain import pushed_body
from modelgen.runtime.iv.thresholds import LED_ORDER, LONGEST_PHASE
from modelgen.runtime.model.model import Model


def ripple(model: Model, body: str, way: float, number: float, phases: Sequence[float]) -> Effect:
    """Return a force on a body that is a sine of its position, in radians per rad or m.

    `way` is the longest that the body goes in a record, in rad or m; `phases` are those in its middle, by
    record, in rad.
    """

    def part(
        name: str, form: Callable[[FloatArray, FloatArray], FloatArray], record: int | None = None
    ) -> Effect:
        return replace(wave(body, number, phases, form, record), name=f"{name} of a ripple on {body}")

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
            return ripple(model, body, way, number, phases)
        by = np.asarray(steps) / size
        # at the ends of the way a step of the number is one of phase
        longest = np.r_[min(2.0 * LONGEST_PHASE / way, 0.5 * number), np.full(len(phases), LONGEST_PHASE)]
        steps_taken = np.clip(by, -longest, longest)
        return ripple(model, body, way, number + float(steps_taken[0]), (phases + steps_taken[1:]).tolist())

    words = f"a force that varies with the position of {body} acts on it, {_period(model, body, number)}"
    remedy = "compensate it in the drive (cogging, ripple of the force), or move over more of its periods"
    return replace(
        wave(body, number, phases, lambda _, phase: np.sin(phase)),
        name=ripple_name(body),
        words=words,
        remedy=remedy,
        shape=shape,
        moved=moved,
        elsewhere=lambda records: waves(body, number, records),
    )


def waves(body: str, number: float, records: int) -> tuple[Effect, ...]:
    """Return a sine and a cosine of so many radians per rad or m in each of so many records."""
    zero = [0.0] * records
    return tuple(
        replace(wave(body, number, zero, form, index), name=f"{name} on {body} in record {index + 1}")
        for index in range(records)
        for name, form in (
            ("sine", lambda _, phase: np.sin(phase)),
            ("cosine", lambda _, phase: np.cos(phase)),
        )
    )


def ripple_name(body: str) -> str:
    """Return the name of the ripple on a body."""
    return f"ripple on {body}"


def wave(
    body: str,
    number: float,
    phases: Sequence[float],
    form: Callable[[FloatArray, FloatArray], FloatArray],
    record: int | None = None,
) -> Effect:
    """Return a force that is a function of a position, from the middle, and of a wave's phase there.

    `form` takes both, in rad or m and in rad, shape (n,) each, to the force in N m or N, shape (n,).
    """

    def changes(simulated: Simulated) -> Changes:
        if record not in (None, simulated.index):
            return {}
        place = position(simulated, body)
        force = form(place, number * place + phases[simulated.index])
        return pushed_body(simulated, body, force)

    return Effect(f"wave on {body}", RIPPLE, "", "", "", changes, record=record)


def position(simulated: Simulated, body: str) -> FloatArray:
    """Return the position of a body in the measured record, from its middle, in rad or m, shape (n,).

    The simulated one, led by the sensor that shows its slow motion best.
    """
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
