"""Effects that a model or its sensors may lack, each as a small change of what a simulation reads.

An effect is known by what it adds to the channels per unit of its size: a late sensor reads -s'(t), a force
on a body moves the chain. Rows are evaluated on readings with and without it; the difference is how their
mismatch Y - W X grows with the size. That holds for any sensor set, and without a row knowing of the effect.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.pushed_chain import deflection_of, pushed
from modelgen.runtime.iv.thresholds import KEPT, LAGS, RESOLVED, SHORTEST_REACH, STRIBECK_QUANTILE
from modelgen.runtime.least_squares.delays import shift
from modelgen.runtime.model.model import Friction, Model, Sensor
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

Changes = Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Effect:
    """Something that may be wrong, in words, and what it does to the channels of a simulated record.

    Attributes
    ----------
    name : str
        "delay of q_c", unique.
    kind : str
        "delay", "direction", "lag", "clock", "gain", "zero", "force" or "mass": how its size is said.
    words, negative : str
        What is said of it where its size is positive, and negative; empty where that cannot be.
    remedy : str
    changes : callable
        Simulated -> what is added to each channel per unit of size, shape (n,) each; empty for a record that
        does not have it.
    edit : callable, optional
        (size, fs in Hz) -> what sets a measured channel `channel` right; where it is linear in the size only
        for small sizes, rows are made of channels set right.
    record : int, optional
        Which record has it; None for what all of them have.
    """

    name: str
    kind: str
    words: str
    negative: str
    remedy: str
    changes: Callable[[Simulated], Changes]
    channel: str = ""
    edit: Callable[[str, float, float], Edit] | None = None
    record: int | None = None

    def corrected(self, record: Record, size: float) -> Record:
        """Return a measured record without the effect, as far as its channels can be set right."""
        if self.edit is None or not size:
            return record
        return record.edited({self.channel: self.edit(self.channel, size, record.fs)})

    def possible(self, size: float) -> bool:
        """Tell whether physics allows the sign."""
        return bool(self.words if size > 0.0 else self.negative)

    def samples(self, size: float, fs: float) -> float:
        """Return the size of a delay or lag in samples at fs, in Hz; 0 for other effects."""
        if self.edit is None:
            return 0.0
        return fs * (abs(size) if self.kind == "delay" else float(np.sqrt(2.0 * abs(size))))

    def said(self, size: float) -> str:
        """Return the effect with its size in words."""
        words, shown = self.words if size > 0.0 else self.negative, abs(size)
        if self.kind in ("delay", DIRECTION):
            return f"{words} by {1e6 * shown:.3g} us"
        if self.kind == "lag":
            return f"{words} (time constant about {1e6 * float(np.sqrt(2.0 * shown)):.2g} us)"
        if self.kind == "clock":
            return f"{words} ({1e6 * size:+.3g} ppm)"
        if self.kind == "gain":
            return f"{words} ({100.0 * size:+.2g} %)"
        if self.kind == "zero":
            return f"{words} ({size:+.3g})"
        return words


ROLE_OF = {"constant force": "offset", "Coulomb friction": "coulomb", "viscous friction": "viscous"}
DIRECTION = "direction"
EITHER_SIGN = ("constant force", "friction by direction")


def effects_of(model: Model, bodies: Sequence[str], records: int) -> tuple[Effect, ...]:
    """Return the effects that are looked for: of sensors, of forces, of bodies and of links."""
    found: list[Effect] = []
    for sensor in model.sensors:
        found += _sensor_effects(sensor, records)
    for actuator in model.actuators:
        found += _force_effects(actuator.key)
    if not model.cubic_springs:
        for body in bodies:
            found += _body_effects(body, _named(model, body))
        found += [_late_direction(one) for one in model.friction if one.coulomb_plus]
        for name, role in model.roles.items():
            if role.role == "stiffness":
                found += _link_effects(name, role.bodies)
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
                 "give all channels the same filter", _with(key, _second), key, _without_lag)  # fmt: skip
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
                 "record the force that acts", _with(key, _second), key, _without_lag)  # fmt: skip
    clock = f"{key} has a clock of its own"
    yield Effect(f"clock of {key}", "clock", clock, clock, "read all channels with one clock",
                 _with(key, _stretched))  # fmt: skip


def _named(model: Model, body: str) -> set[str]:
    """Return which forces on a body the spec names, known or not."""
    found = {role.role for role in model.roles.values() if role.bodies == (body,)}
    for friction in model.friction:
        if friction.body == body:
            found |= {"coulomb"} if friction.coulomb_plus else set()
            found |= {"offset"} if friction.offset else set()
            found |= {"viscous"} if friction.asymmetric else set()
    return found


def _body_effects(body: str, named: Collection[str]) -> Iterator[Effect]:
    forms: dict[str, tuple[str, Callable[[FloatArray], FloatArray]]] = {
        "constant force": ("a constant force (offset)", np.ones_like),
        "Coulomb friction": ("Coulomb friction that the spec does not name", np.sign),
        "viscous friction": ("viscous friction that the spec does not name", np.asarray),
        "quadratic friction": ("friction that grows with the square of the speed", lambda v: v * np.abs(v)),
        "friction by direction": ("viscous friction that depends on the direction", np.abs),
        "Stribeck friction": ("more friction at low speed (Stribeck)", _stribeck),
    }
    for name, (words, form) in forms.items():
        if ROLE_OF.get(name) in named:
            continue
        negative = f"{words} acts on {body}" if name in EITHER_SIGN else ""
        yield Effect(f"{name} on {body}", "force", f"{words} acts on {body}", negative, "add it to the spec",
                     _friction(body, form))  # fmt: skip
    yield Effect(f"further mass on {body}", "mass", f"a further mass on a spring hangs on {body}",
                 "", "add the body to the spec, or excite less of the high frequencies",
                 _further_mass(body))  # fmt: skip


def _late_direction(friction: Friction) -> Effect:
    """Return that the direction of a body changes too late: it is that of a low-passed velocity."""
    body, name = friction.body, friction.coulomb_plus or ""

    def changes(simulated: Simulated) -> Changes:
        push = np.array([float(one == body) for one in simulated.plant.bodies])
        level = simulated.plant.parameters[name]
        jumps = np.gradient(np.sign(simulated.motion[f"v_{body}"]), simulated.record.dt)
        return pushed(simulated, push, -level * jumps)

    return Effect(f"direction of {body}", DIRECTION, f"the direction of {body} changes late",
                  f"the direction of {body} changes early",
                  "record a motion that reverses less often", changes)  # fmt: skip


def _link_effects(stiffness: str, bodies: tuple[str, ...]) -> Iterator[Effect]:
    pair = " and ".join(bodies)
    yield Effect(f"stiffening of {stiffness}", "force", f"{stiffness} between {pair} stiffens",
                 f"{stiffness} between {pair} softens",
                 "compare amplitudes; give the link a stiffness3",
                 _spring(stiffness, lambda d: d**3))  # fmt: skip
    yield Effect(f"backlash of {stiffness}", "force", f"there is backlash between {pair}",
                 f"{stiffness} between {pair} softens", "compare amplitudes, or preload the link",
                 _spring(stiffness, lambda d: -np.sign(d)))  # fmt: skip


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


def _second(samples: FloatArray, dt: float) -> FloatArray:
    return np.asarray(np.gradient(np.gradient(samples, dt), dt))


def _stretched(samples: FloatArray, dt: float) -> FloatArray:
    """Return t s'(t): what a clock that runs slow adds; t from the middle, as delays are looked for apart."""
    t = dt * (np.arange(len(samples)) - 0.5 * len(samples))
    return np.asarray(t * np.gradient(samples, dt))


def _stribeck(v: FloatArray) -> FloatArray:
    slow = float(np.quantile(np.abs(v), STRIBECK_QUANTILE)) or float(np.max(np.abs(v))) or 1.0
    return np.asarray(np.sign(v) * np.exp(-np.abs(v) / slow))


def _friction(body: str, form: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        push = np.array([float(name == body) for name in simulated.plant.bodies])
        return pushed(simulated, push, -form(simulated.motion[f"v_{body}"]))

    return changes


def _further_mass(body: str) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        push = np.array([float(name == body) for name in simulated.plant.bodies])
        jerk_rate = _second(simulated.motion[f"a_{body}"], simulated.record.dt)
        place = simulated.plant.bodies.index(body)
        # J_x s^2 / (1 + s^2 / w^2): J_x s^2 is the body's, the next term - J_x s^4 / w^2 pulls
        return pushed(simulated, push, simulated.plant.inertia[place] * jerk_rate)

    return changes


def _spring(stiffness: str, form: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        lever = deflection_of(simulated.plant, stiffness)
        motion = [simulated.motion[f"q_{body}"] for body in simulated.plant.bodies]
        d = sum(share * q for share, q in zip(lever, motion, strict=True))
        d = d - np.mean(d)
        return pushed(simulated, lever, -form(d / (np.std(d) or 1.0)))

    return changes
