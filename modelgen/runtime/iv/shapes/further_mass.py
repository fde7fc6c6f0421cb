"""A further mass on a spring, with a frequency and a damping of its own, as an effect of a body's motion.

What hangs on a body pulls with J_x G(s) times its acceleration, G = (1 + 2 z u) / (1 + 2 z u + u^2) with
u = s / w. Far below w that is inertia; about w no series holds. It is worked out along the measured motion,
in which all of it is. J_x is its size, w, z and how the mass moves when a record begins are its shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.derivatives import differentiate, stencil_for
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.pushed_chain import pushed_body
from modelgen.runtime.iv.thresholds import CLEAR_ACCELERATION, LEAST_DAMPING, LONGEST_STEPS

Response = Callable[[ComplexArray], ComplexArray]


def further_mass(body: str, hz: float, damping: float, slowest_hz: float = 0.0) -> Effect:
    """Return a mass on a spring on a body: its frequency in Hz, its damping ratio; a size is its inertia.

    Steps lead to no frequency below `slowest_hz`: what swings that slowly is a force.
    """

    def transmitted(f: ComplexArray) -> ComplexArray:
        u = f / hz
        return (1.0 + 2.0 * damping * u) / (1.0 + 2.0 * damping * u + u**2)

    def by_frequency(f: ComplexArray) -> ComplexArray:
        u = f / hz  # d G / d ln w
        return (2.0 * u**2 + 2.0 * damping * u**3) / (1.0 + 2.0 * damping * u + u**2) ** 2

    def by_damping(f: ComplexArray) -> ComplexArray:
        u = f / hz  # d G / d ln z
        return 2.0 * damping * u**3 / (1.0 + 2.0 * damping * u + u**2) ** 2

    def shape(records: int) -> tuple[Effect, ...]:
        parts = [("frequency", by_frequency), ("damping", by_damping)]
        places = [(index, phase) for index in range(records) for phase in (0.0, 0.5 * np.pi)]
        return (
            *(_part(f"{name} of a mass on {body}", body, response) for name, response in parts),
            *(_ringing(body, hz, damping, index, phase) for index, phase in places),
        )

    def moved(size: float, steps: Sequence[float]) -> Effect:
        if not size:  # a mass of no size stays where it is
            return further_mass(body, hz, damping, slowest_hz)
        stretch, more = np.exp(np.clip(np.asarray(steps[:2]) / size, *LONGEST_STEPS)).tolist()
        moved_hz = max(hz * stretch, slowest_hz)
        return further_mass(body, moved_hz, max(damping * more, LEAST_DAMPING), slowest_hz)

    def acting(simulated: Simulated, size: float) -> Simulated:
        return _with_mass(simulated, body, lambda f: size * transmitted(f))

    words = f"a further mass on a spring hangs on {body}, with a resonance of its own near {hz:.3g} Hz"
    remedy = "add the body to the spec, or excite less of the high frequencies"
    effect = _part(f"further mass on {body}", body, transmitted)
    return replace(effect, words=words, remedy=remedy, acting=acting, shape=shape, moved=moved)


def _part(name: str, body: str, response: Response) -> Effect:
    """Return an effect that pulls at a body with an acceleration behind a response, which takes i f in Hz."""

    def pulled(a: FloatArray, simulated: Simulated) -> Changes:
        return pushed_body(simulated, body, -through(a, simulated.record.dt, response))

    return Effect(
        name, "resonance", "", "", "", lambda simulated: pulled(_measured(simulated, body), simulated),
        quiet=lambda simulated: pulled(simulated.motion[f"a_{body}"], simulated),
    )  # fmt: skip


def _ringing(body: str, hz: float, damping: float, index: int, phase: float) -> Effect:
    """Return what a mass does that moved when a record began, in one of two phases."""

    def changes(simulated: Simulated) -> Changes:
        if simulated.index != index:
            return {}
        wt = 2.0 * np.pi * hz * simulated.record.dt * np.arange(simulated.record.n)
        return pushed_body(simulated, body, np.exp(-damping * wt) * np.cos(wt - phase))

    name = f"start of a mass on {body} in record {index + 1}, at {phase:.2g} rad"
    return Effect(name, "resonance", "", "", "", changes, record=index)


def through(a: FloatArray, dt: float, response: Response) -> FloatArray:
    """Return a signal dt s a sample behind a response to i f in Hz, in its unit, shape (n,).

    At the frequencies of `Simulated.held`.
    """
    size = quick_length(len(a))
    padded = np.concatenate([a, np.linspace(a[-1], a[0], size - len(a) + 2)[1:-1]])
    f = np.asarray(1j * np.fft.rfftfreq(size, dt), dtype=np.complex128)
    spectrum = response(f) * np.fft.rfft(padded)
    return np.fft.irfft(spectrum, size)[: len(a)]


def _with_mass(simulated: Simulated, body: str, pull: Response) -> Simulated:
    """Return a simulation with the force -pull(i f) a on a body, and what that does to its acceleration a."""
    held, dt = simulated.held, simulated.record.dt
    push = np.array([float(name == body) for name in simulated.plant.bodies])
    moved = held.acceleration(push)
    a = through(simulated.motion[f"a_{body}"], dt, lambda f: 1.0 / (1.0 + pull(f) * moved))
    changes = pushed_body(simulated, body, -through(a, dt, pull))
    record = simulated.record.edited({key: simulated.record.signals[key] + changes[key] for key in changes})
    return replace(simulated, record=record, motion={**simulated.motion, f"a_{body}": a})


def _measured(simulated: Simulated, body: str) -> FloatArray:
    """Return the acceleration of a body: that of the record where a sensor shows it clearly, shape (n,).

    Rows low-pass what is linear in it; noise counts up to the frequency to which the record leads a motion.
    """
    a, record, wide = simulated.motion[f"a_{body}"], simulated.measured, simulated.led_hz
    if record is None:
        return a
    for sensor in simulated.plant.model.sensors:
        if sensor.body != body or sensor.key not in record.signals:
            continue
        times = 2 - sensor.order
        power = (2.0 * np.pi * wide) ** (2 * times) * wide / (2 * times + 1)
        if record.facts.spectrum(sensor.key).noise * power < CLEAR_ACCELERATION * float(np.var(a)):
            samples = record.signals[sensor.key]
            read = differentiate(samples, record.dt, times, stencil_for(wide, record.fs))
            return np.asarray(read - np.mean(read))
    return a
