"""A chain for MuJoCo: a joint a body with armature, damping and frictionloss, a tendon a spring.

MuJoCo's friction holds a resting joint by a soft constraint: it drifts slowly where the chain would stick.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.exports.case import Case, Written, per_sample
from modelgen.runtime.exports.mechanics import Lever, MechanicalBody
from modelgen.runtime.exports.plain_text import free_name, xml_attribute, xml_comment

# MuJoCo's least mass is 1e-15; what a body has of the inertia, its joint's armature has not
BODY_SHARE, LEAST_MASS = 1e-6, 2e-15
STEPS_PER_RADIAN = 20.0  # of the fastest mode
LARGEST_STEP_S = 1e-3
MOTION = {"rotation": ("hinge", "0 0 1"), "translation": ("slide", "1 0 0")}
SENSORS = {0: "pos", 1: "vel"}


def write(case: Case) -> Written:
    """Return an MJCF model, and one for every sample.

    Raises
    ------
    DataError
        For a cubic spring, which MuJoCo does not have.
    """
    cubic = [
        s.stiffness3 for s in case.mechanics.springs if s.stiffness3 and case.values.nominal[s.stiffness3]
    ]
    if cubic:
        what = "is a cubic stiffness, which an MJCF tendon does not have"
        raise DataError.at(f"parameters: {cubic[0]}", what, f"leave it out with --set {cubic[0]}=0")
    notes = ["friction at rest is a soft constraint of MuJoCo: a body that sticks drifts slowly"]
    directed = [body.name for body in case.mechanics.bodies if body.asymmetric and body.viscous[0]]
    if directed:
        notes.append(f"viscous friction that differs by direction is the mean of both: {', '.join(directed)}")
    combined = [r.key for r in case.mechanics.readings if r.order == 2 and len(r.lever) > 1]
    if combined:
        notes.append(f"MJCF has no sensor for the relative acceleration {', '.join(combined)}: left out")
    return Written(per_sample(case, lambda values: "\n".join(_lines(case, values)) + "\n"), tuple(notes))


def _lines(case: Case, values: Mapping[str, float]) -> Iterator[str]:
    yield f"<mujoco model={xml_attribute(case.name)}>"
    yield f"  {xml_comment(case.model.title + '; SI units, one joint a body, no gravity')}"
    yield '  <compiler angle="radian"/>'
    step = step_s(case, values)
    yield f'  <option timestep="{step!r}" integrator="implicitfast" gravity="0 0 0">'
    yield '    <flag contact="disable"/>'
    yield "  </option>"
    yield "  <worldbody>"
    for place, body in enumerate(case.mechanics.bodies):
        yield from _body_lines(case, values, place, body)
    yield "  </worldbody>"
    tendons = list(_tendons(case, values))
    if tendons:
        yield from ("  <tendon>", *tendons, "  </tendon>")
    yield from ("  <actuator>", *_actuators(case, values), "  </actuator>")
    yield from ("  <sensor>", *_sensors(case), "  </sensor>", "</mujoco>")


def step_s(case: Case, values: Mapping[str, float]) -> float:
    """Return a step in s that resolves the chain's fastest motion, to two digits."""
    full = {**dict.fromkeys(case.model.every_parameter, 0.0), **values}
    space = case.model.state_space(full, {body.name: 1 for body in case.mechanics.bodies})
    fastest = float(np.abs(np.linalg.eigvals(space.A)).max())
    return float(f"{min(LARGEST_STEP_S, 1.0 / max(STEPS_PER_RADIAN * fastest, 1e-9)):.1e}")


def _body_lines(case: Case, values: Mapping[str, float], place: int, body: MechanicalBody) -> Iterator[str]:
    inertia = values[body.inertia]
    own = max(BODY_SHARE * inertia, LEAST_MASS)
    kind, axis = MOTION[body.motion]
    viscous = [values[name] if name else 0.0 for name in body.viscous]
    coulomb = coulomb_of(body, values)
    joint = {
        "armature": inertia - own,
        "damping": sum(viscous) / 2.0,
        "frictionloss": sum(coulomb) / 2.0,
        "stiffness": 0.0,
    }
    for spring in case.mechanics.springs:
        if len(spring.lever) == 1 and spring.lever[0][0] == place:
            factor = spring.lever[0][1] ** 2
            joint["stiffness"] += factor * values[spring.stiffness] if spring.stiffness else 0.0
            joint["damping"] += factor * values[spring.damping] if spring.damping else 0.0
    written = " ".join(f'{key}="{size!r}"' for key, size in joint.items() if size)
    yield f'    <body name="{body.name}" pos="0 0 {0.1 * place:.1f}">'
    yield f'      <inertial pos="0 0 0" mass="{own!r}" diaginertia="{own!r} {own!r} {own!r}"/>'
    yield f'      <joint name="{body.name}" type="{kind}" axis="{axis}" {written}'.rstrip()
    yield '             solreffriction="0.0001 1" solimpfriction="0.999 0.9999 0.001"/>'
    yield f'      <site name="{body.name}"/>'
    yield "    </body>"


def coulomb_of(body: MechanicalBody, values: Mapping[str, float]) -> tuple[float, float]:
    """Return a body's Coulomb friction forwards and backwards."""
    friction = body.friction
    if friction is None:
        return 0.0, 0.0
    names = (friction.coulomb_plus, friction.coulomb_minus)
    plus, minus = (values[name] if name else 0.0 for name in names)
    return plus, minus


def steady_force(body: MechanicalBody, values: Mapping[str, float]) -> float:
    """Return the constant part of a body's friction, once the mean Coulomb friction is taken off."""
    plus, minus = coulomb_of(body, values)
    offset = body.friction.offset if body.friction else None
    return 0.5 * (plus - minus) + (values[offset] if offset else 0.0)


def _fixed(lever: Lever, case: Case) -> str:
    return "".join(
        f'<joint joint="{case.mechanics.bodies[place].name}" coef="{factor!r}"/>' for place, factor in lever
    )


def _tendons(case: Case, values: Mapping[str, float]) -> Iterator[str]:
    for number, spring in enumerate(case.mechanics.springs, 1):
        if len(spring.lever) == 1:
            continue
        written = " ".join(
            f'{key}="{values[name]!r}"'
            for key, name in (("stiffness", spring.stiffness), ("damping", spring.damping))
            if name
        )
        attributes = f'name="spring_{number}" springlength="0" {written}'
        yield f"    <fixed {attributes}>{_fixed(spring.lever, case)}</fixed>"
    for reading in case.mechanics.readings:
        if reading.order < 2 and not _is_single(reading.lever):
            yield f'    <fixed name="sense_{reading.key}">{_fixed(reading.lever, case)}</fixed>'


def _is_single(lever: Lever) -> bool:
    return len(lever) == 1 and lever[0][1] == 1.0


def _actuators(case: Case, values: Mapping[str, float]) -> Iterator[str]:
    for push in case.mechanics.pushes:
        yield f'    <motor name="{push.key}" joint="{case.mechanics.bodies[push.body].name}"/>'
    for body in case.mechanics.bodies:
        force = steady_force(body, values)
        if force:
            name = free_name(f"offset_{body.name}", [push.key for push in case.mechanics.pushes])
            attributes = f'gainprm="0 0 0" biastype="affine" biasprm="{-force!r} 0 0"'
            yield f'    <general name="{name}" joint="{body.name}" {attributes}/>'


def _sensors(case: Case) -> Iterator[str]:
    for reading in case.mechanics.readings:
        body = case.mechanics.bodies[reading.lever[0][0]] if reading.lever else None
        if body is None:
            continue
        if reading.order < 2:
            where = (
                f'<joint{SENSORS[reading.order]} name="{reading.key}" joint="{body.name}"/>'
                if _is_single(reading.lever)
                else f'<tendon{SENSORS[reading.order]} name="{reading.key}" tendon="sense_{reading.key}"/>'
            )
            yield f"    {where}"
        elif _is_single(reading.lever):
            kind = "frameangacc" if body.motion == "rotation" else "framelinacc"
            yield f'    <{kind} name="{reading.key}" objtype="site" objname="{body.name}"/>'
