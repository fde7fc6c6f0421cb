"""Effects of the chain that a model may lack: forces on a body, a further mass, what a link does."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filters.derivatives import differentiate, integral
from modelgen.runtime.filters.low_cosines import slowest
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.companion_simulation import Further, Simulated
from modelgen.runtime.iv.effect import DIRECTION, REVERSAL, Changes, Effect, curvature
from modelgen.runtime.iv.pushed_chain import Pushed, deflection_of, pushed_body, pushed_link
from modelgen.runtime.iv.thresholds import (
    FAR_OFF,
    GIVEN_ROUNDS,
    INTEGRATED_FROM,
    LED_ORDER,
    ROUNDED,
    UNCLEAR,
)
from modelgen.runtime.model.mechanical_parts import Friction
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record

ROLE_OF = {"constant force": "offset", "Coulomb friction": "coulomb", "viscous friction": "viscous"}
KIND_OF = {"constant force": "constant", "Coulomb friction": "force", "viscous friction": "force"}
EITHER_SIGN = ("constant force", "friction by direction")


def chain_effects(model: Model, bodies: Sequence[str], turning: bool) -> Iterator[Effect]:
    """Yield the effects of bodies and of links; `turning` says whether samples about reversals are used."""
    for body in bodies:
        yield from _body_effects(body, _named(model, body), turning)
    for friction in model.friction:
        if friction.coulomb_plus and turning:
            yield _late_direction(friction)
    for name, role in model.roles.items():
        if role.role == "stiffness":
            yield from _link_effects(name, role.ends)


def _named(model: Model, body: str) -> set[str]:
    """Return which forces on a body the spec names, known or not."""
    found = {role.role for role in model.roles.values() if role.bodies == (body,)}
    for friction in model.friction:
        if friction.body == body:
            found |= {"coulomb"} if friction.coulomb_plus else set()
            found |= {"offset"} if friction.offset else set()
            found |= {"viscous"} if friction.asymmetric else set()
    return found


def _body_effects(body: str, named: Collection[str], turning: bool) -> Iterator[Effect]:
    forms: dict[str, tuple[str, Callable[[FloatArray], FloatArray]]] = {
        "constant force": ("a constant force (offset)", np.ones_like),
        "Coulomb friction": ("Coulomb friction that the spec does not name", np.sign),
        "viscous friction": ("viscous friction that the spec does not name", np.asarray),
        "quadratic friction": ("friction that grows with the square of the speed", lambda v: v * np.abs(v)),
        "friction by direction": ("viscous friction that depends on the direction", np.abs),
    }
    for name, (words, form) in forms.items():
        if ROLE_OF.get(name) in named:
            continue
        negative = f"{words} acts on {body}" if name in EITHER_SIGN else ""
        kind, said = KIND_OF.get(name, "form"), f"{words} acts on {body}"
        changes, turns = _friction(body, form), body if ROLE_OF.get(name) == "coulomb" else ""
        yield Effect(f"{name} on {body}", kind, said, negative, "add it to the spec", changes, turns=turns)
    words = f"more friction at low speed (Stribeck) acts on {body}"
    kind = REVERSAL if turning else "form"
    yield Effect(f"Stribeck friction on {body}", kind, words, "", "add it to the spec", _stribeck(body))
    yield Effect(f"further mass on {body}", "mass", f"a further mass on a spring hangs on {body}",
                 "", "add the body to the spec, or excite less of the high frequencies",
                 _further_mass(body))  # fmt: skip


def _late_direction(friction: Friction) -> Effect:
    """Return that the direction of a body changes too late: it is that of a low-passed velocity."""
    body, name = friction.body, friction.coulomb_plus or ""

    def force(simulated: Simulated) -> FloatArray:
        level = simulated.plant.parameters[name]
        return -level * np.gradient(np.sign(simulated.led[body].speed), simulated.record.dt)

    return Effect(f"direction of {body}", DIRECTION, f"the direction of {body} changes late",
                  f"the direction of {body} changes early",
                  "record a motion that reverses less often", on_body(body, force))  # fmt: skip


def _link_effects(stiffness: str, pair: str) -> Iterator[Effect]:
    bends, plays = _spring(stiffness, lambda d: d * d * d), _spring(stiffness, lambda d: -np.sign(d))
    stiffens = Effect(f"stiffening of {stiffness}", "form", f"{stiffness} between {pair} stiffens",
                      f"{stiffness} between {pair} softens",
                      "compare amplitudes; give the link a stiffness3",
                      lambda simulated: bends(simulated, 0.0), at=bends)  # fmt: skip
    # a gap has one sign
    gap = Effect(f"backlash of {stiffness}", "form", f"there is backlash between {pair}", "",
                 "compare amplitudes, or preload the link",
                 lambda simulated: plays(simulated, 0.0), at=plays)  # fmt: skip
    # along its tangent either may explain what the other one does
    yield from (replace(stiffens, forms=(gap,)), replace(gap, forms=(stiffens,)))


def _stribeck(body: str) -> Callable[[Simulated], Changes]:
    """Return what friction does that falls with the speed, from a speed on that all records share."""

    def force(simulated: Simulated) -> FloatArray:
        v = simulated.led[body].speed
        return np.asarray(-np.sign(v) * np.exp(-np.abs(v) / simulated.slow[body]))

    return on_body(body, force)


def on_body(body: str, force: Callable[[Simulated], FloatArray]) -> Callable[[Simulated], Changes]:
    """Return what a force on a body, in N m or N, shape (n,), changes in the channels."""
    return lambda simulated: pushed_body(simulated, body, force(simulated))


def _friction(body: str, form: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    return on_body(body, lambda simulated: -form(simulated.led[body].speed))


def _further_mass(body: str) -> Callable[[Simulated], Changes]:
    def force(simulated: Simulated) -> FloatArray:
        inertia = simulated.plant.inertia[simulated.plant.bodies.index(body)]
        # J_x s^2 / (1 + s^2 / w^2): J_x s^2 is the body's, the next term - J_x s^4 / w^2 pulls
        return np.asarray(inertia * curvature(simulated.motion[f"a_{body}"], simulated.record.dt))

    return on_body(body, force)


def _spring(
    stiffness: str, form: Callable[[FloatArray], FloatArray]
) -> Callable[[Simulated, float], Changes]:
    """Return what a link does beyond its stiffness, per unit of its size, where that has a size already."""

    def changes(simulated: Simulated, size: float) -> Changes:
        if not size:
            return pushed_link(simulated, stiffness, form(deflection(simulated, stiffness)))
        lever, value = deflection_of(simulated.plant, stiffness), simulated.plant.parameters[stiffness]
        if not value:
            what = "is zero at the estimate: its link carries no force that may depend on its deflection"
            raise IdentifiabilityError.at(stiffness, what, "excite the link more")
        give = size / value
        return Pushed(simulated, lever, -form(_deflection(simulated, lever, lambda d: give * form(d))))

    return changes


def deflection(simulated: Simulated, stiffness: str) -> FloatArray:
    """Return the deflection of the link of a stiffness that is linear, in rad or m, shape (n,)."""
    key = "deflection", stiffness
    if key not in simulated.places:
        simulated.places[key] = _deflection(simulated, deflection_of(simulated.plant, stiffness))
    return simulated.places[key]


def simulated_deflection(simulated: Simulated, stiffness: str) -> FloatArray:
    """Return the deflection of a link in the simulation, in rad or m, shape (n,)."""
    return _sum_of(simulated, _ends(simulated, deflection_of(simulated.plant, stiffness)))


def acceleration(simulated: Simulated, body: str) -> FloatArray:
    """Return the acceleration of a body, in rad/s^2 or m/s^2, shape (n,): that of the record where it shows.

    What the model lacks has moved the record, and not the simulation; noise as in `_deflection`.
    """
    key = "acceleration", body
    if key not in simulated.places:
        simulated.places[key] = _acceleration(simulated, body, simulated.measured)
    return simulated.places[key]


def _acceleration(simulated: Simulated, body: str, record: Record | None) -> FloatArray:
    own = simulated.motion[f"a_{body}"]
    shown = None if record is None else simulated.away(body, record) or simulated.further(body, record)
    if record is None or shown is None:
        return own
    further = zero_phase(shown.motion, LED_ORDER, simulated.led_hz, record.fs)
    further = differentiate(further, record.dt, 2 - shown.order)
    noise = _noise_as(shown, 2, 0.0, simulated.led_hz)
    clear = noise < max(UNCLEAR * float(np.var(own)), FAR_OFF * float(np.var(further)))
    return np.asarray(own + further if clear else own)


def _deflection(
    simulated: Simulated, lever: FloatArray, less: Callable[[FloatArray], FloatArray] | None = None
) -> FloatArray:
    """Return the deflection of a link, shape (n,): that of the record where sensors see it clearly.

    Their noise is in the residual as well, where it would look like what bends the spring: it has to be
    little beside the deflection, or beside what a simulation is off by. Zeros of encoders are in the mean,
    which is left out. Speeds and accelerations are integrated from the lowest frequency on at which their
    noise lets them; below, a link gives by as much `less` as it bends by its form alone.
    """
    ends = _ends(simulated, lever)
    d = _sum_of(simulated, ends)
    away = [(share, simulated.led[body].away) for share, body in ends]
    known = [(share, one) for share, one in away if one is not None]
    if len(known) < len(away):
        return d
    fs, led_hz = simulated.record.fs, simulated.led_hz
    # what the bodies do together is gone before the drift is
    apart = _without_drift(known, fs)
    drifts = any(one.order for _, one in known)
    for low_hz in (simulated.slow_hz * share for share in (INTEGRATED_FROM if drifts else (0.0,))):
        noise = sum(share**2 * _noise_as(one, 0, low_hz, led_hz) for share, one in known)
        further = zero_phase(_above(apart, low_hz, fs), LED_ORDER, led_hz, fs)
        if noise < max(UNCLEAR * float(np.var(d)), FAR_OFF * float(np.var(further))):
            return _given(d + further, less, low_hz, fs) if drifts and less else np.asarray(d + further)
    return d


def _ends(simulated: Simulated, lever: FloatArray) -> list[tuple[float, str]]:
    """Return the bodies that a deflection is a sum of, each with its share."""
    pairs = zip(lever.tolist(), simulated.plant.bodies, strict=True)
    return [(share, body) for share, body in pairs if abs(share) > ROUNDED * np.max(np.abs(lever))]


def _sum_of(simulated: Simulated, ends: Sequence[tuple[float, str]]) -> FloatArray:
    return np.asarray(sum(share * simulated.motion[f"q_{body}"] for share, body in ends))


def _given(d: FloatArray, less: Callable[[FloatArray], FloatArray], low_hz: float, fs: float) -> FloatArray:
    """Return a deflection that is less below a frequency in Hz by what a function of it says, shape (n,).

    By no more than the largest there is: with a wrong size the steps may run away.
    """
    slow, most, count = np.zeros_like(d), np.max(np.abs(d)), _count_below(low_hz, len(d), fs)
    for _ in range(GIVEN_ROUNDS):
        more = np.clip(less(d - slow), -most, most)
        slow = 0.5 * (slow + slowest(more, count))
    return np.asarray(d - slow)


def _above(samples: FloatArray, low_hz: float, fs: float) -> FloatArray:
    """Return samples without their cosines below a frequency in Hz, shape (n,)."""
    return np.asarray(samples - slowest(samples, _count_below(low_hz, len(samples), fs)))


def _count_below(low_hz: float, n: int, fs: float) -> int:
    return int(low_hz * 2 * n / fs)


def _without_drift(known: Sequence[tuple[float, Further]], fs: float) -> FloatArray:
    """Return a sum of readings as positions, shape (n,), without what zeros of all of them may be of it."""
    order, total = 0, np.zeros(len(known[0][1].motion))
    for share, away in known:
        samples = away.motion
        for _ in range(away.order):
            samples = integral(samples, 1.0 / fs)
        order, total = max(order, away.order), total + share * samples
    time = np.linspace(-1.0, 1.0, len(total))
    drift = np.polynomial.legendre.legvander(time, order)
    return np.asarray(total - drift @ np.linalg.lstsq(drift, total, rcond=None)[0])


def _noise_as(away: Further, order: int, low_hz: float, high_hz: float) -> float:
    """Return the noise power of a reading as a derivative of the position, between frequencies in Hz."""
    power = 1 + 2 * (order - away.order)
    slope = (2.0 * np.pi) ** (power - 1) / power
    return float(away.noise * slope * (high_hz**power - (low_hz**power if low_hz else 0.0)))
