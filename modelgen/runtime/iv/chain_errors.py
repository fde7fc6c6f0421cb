"""Effects of the chain that a model may lack: forces on a body, a further mass, what a link does."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import DIRECTION, REVERSAL, Changes, Effect, curvature
from modelgen.runtime.iv.pushed_chain import Pushed, deflection_of, pushed_body
from modelgen.runtime.iv.thresholds import ROUNDED, UNCLEAR
from modelgen.runtime.model.mechanical_parts import Friction
from modelgen.runtime.model.model import Model

ROLE_OF = {"constant force": "offset", "Coulomb friction": "coulomb", "viscous friction": "viscous"}
KIND_OF = {"constant force": "constant", "Coulomb friction": "force", "viscous friction": "force"}
EITHER_SIGN = ("constant force", "friction by direction")


def chain_effects(model: Model, bodies: Sequence[str], turning: bool) -> Iterator[Effect]:
    """Yield the effects of bodies and of links; none with cubic springs: such a chain is not linear.

    `turning` says whether samples about reversals are used.
    """
    if model.cubic_springs:
        return
    for body in bodies:
        yield from _body_effects(body, _named(model, body), turning)
    for friction in model.friction:
        if friction.coulomb_plus and turning:
            yield _late_direction(friction)
    for name, role in model.roles.items():
        if role.role == "stiffness":
            yield from _link_effects(name, role.bodies)


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
        changes = _friction(body, form)
        yield Effect(f"{name} on {body}", kind, said, negative, "add it to the spec", changes)
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
                  "record a motion that reverses less often", _on_body(body, force))  # fmt: skip


def _link_effects(stiffness: str, bodies: tuple[str, ...]) -> Iterator[Effect]:
    pair = " and ".join(bodies)
    yield Effect(f"stiffening of {stiffness}", "form", f"{stiffness} between {pair} stiffens",
                 f"{stiffness} between {pair} softens",
                 "compare amplitudes; give the link a stiffness3",
                 _spring(stiffness, lambda d: d**3))  # fmt: skip
    # a gap has one sign
    yield Effect(f"backlash of {stiffness}", "form", f"there is backlash between {pair}", "",
                 "compare amplitudes, or preload the link",
                 _spring(stiffness, lambda d: -np.sign(d)))  # fmt: skip


def _stribeck(body: str) -> Callable[[Simulated], Changes]:
    """Return what friction does that falls with the speed, from a speed on that all records share."""

    def force(simulated: Simulated) -> FloatArray:
        v = simulated.led[body].speed
        return np.asarray(-np.sign(v) * np.exp(-np.abs(v) / simulated.slow[body]))

    return _on_body(body, force)


def _on_body(body: str, force: Callable[[Simulated], FloatArray]) -> Callable[[Simulated], Changes]:
    """Return what a force on a body, in N m or N, shape (n,), changes in the channels."""
    return lambda simulated: pushed_body(simulated, body, force(simulated))


def _friction(body: str, form: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    return _on_body(body, lambda simulated: -form(simulated.led[body].speed))


def _further_mass(body: str) -> Callable[[Simulated], Changes]:
    def force(simulated: Simulated) -> FloatArray:
        inertia = simulated.plant.inertia[simulated.plant.bodies.index(body)]
        # J_x s^2 / (1 + s^2 / w^2): J_x s^2 is the body's, the next term - J_x s^4 / w^2 pulls
        return np.asarray(inertia * curvature(simulated.motion[f"a_{body}"], simulated.record.dt))

    return _on_body(body, force)


def _spring(stiffness: str, form: Callable[[FloatArray], FloatArray]) -> Callable[[Simulated], Changes]:
    def changes(simulated: Simulated) -> Changes:
        lever = deflection_of(simulated.plant, stiffness)
        return Pushed(simulated, lever, -form(_deflection(simulated, lever)))

    return changes


def _deflection(simulated: Simulated, lever: FloatArray) -> FloatArray:
    """Return the deflection of a link, shape (n,): that of the record where encoders see it clearly.

    Their noise is in the residual as well, where it would look like what bends the spring. Their zeros are
    in the mean, which is left out.
    """
    ends = [
        (share, body)
        for share, body in zip(lever.tolist(), simulated.plant.bodies, strict=True)
        if abs(share) > ROUNDED * np.max(np.abs(lever))
    ]
    d = np.asarray(sum(share * simulated.motion[f"q_{body}"] for share, body in ends))
    away = [(share, simulated.led[body].away) for share, body in ends]
    known = [(share, *one) for share, one in away if one is not None]
    if len(known) < len(away):
        return d
    noise = sum((share * rms) ** 2 for share, _, rms in known)
    if noise > UNCLEAR * float(np.var(d)):
        return d
    further = np.asarray(sum(share * samples for share, samples, _ in known))
    return np.asarray(d + further - np.mean(further))
