"""A chain as URDF: a joint to the base a body, with damping and friction; comments say what URDF cannot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modelgen.runtime.exports.case import Case, Written, per_sample
from modelgen.runtime.exports.mechanics import MechanicalBody
from modelgen.runtime.exports.mjcf import coulomb_of
from modelgen.runtime.exports.plain_text import free_name, xml_attribute, xml_comment

NOTE = "URDF has no springs between joints: stiffness and damping of links stand in comments"
MOTION = {"rotation": ("continuous", "0 0 1"), "translation": ("prismatic", "1 0 0")}


def write(case: Case) -> Written:
    """Return a URDF model, and one for every sample."""
    notes = [NOTE] if case.mechanics.springs else []
    uneven = [b.name for b in case.mechanics.bodies if b.asymmetric]
    if uneven:
        notes.append(f"friction that differs by direction is the mean of both: {', '.join(uneven)}")
    offsets = [
        b.friction.offset
        for b in case.mechanics.bodies
        if b.friction and b.friction.offset and case.values.nominal[b.friction.offset]
    ]
    if offsets:
        notes.append(f"URDF has no constant force: {', '.join(offsets)} stand in comments")
    return Written(per_sample(case, lambda values: "\n".join(_lines(case, values)) + "\n"), tuple(notes))


def _lines(case: Case, values: Mapping[str, float]) -> Iterator[str]:
    bodies = case.mechanics.bodies
    base = free_name("base", [f"{body.name}_link" for body in bodies])
    yield '<?xml version="1.0"?>'
    yield f"<robot name={xml_attribute(case.name)}>"
    yield f"  {xml_comment(case.model.title + '; SI units')}"
    yield f'  <link name="{base}"/>'
    for body in bodies:
        yield from _body_lines(body, values, base)
    for spring in case.mechanics.springs:
        lever = " ".join(f"{factor:+.17g}*{bodies[place].name}" for place, factor in spring.lever)
        sizes = ", ".join(
            f"{role} {name} = {values[name]!r}"
            for role, name in (
                ("stiffness", spring.stiffness),
                ("damping", spring.damping),
                ("cubic stiffness", spring.stiffness3),
            )
            if name
        )
        yield f"  {xml_comment(f'spring of the deflection {lever}: {sizes}')}"
    for push in case.mechanics.pushes:
        name = bodies[push.body].name
        interface = "EffortJointInterface"
        yield f'  <transmission name="{push.key}">'
        yield "    <type>transmission_interface/SimpleTransmission</type>"
        yield f'    <joint name="{name}"><hardwareInterface>{interface}</hardwareInterface></joint>'
        yield f'    <actuator name="{push.key}"><mechanicalReduction>1</mechanicalReduction></actuator>'
        yield "  </transmission>"
    yield "</robot>"


def _body_lines(body: MechanicalBody, values: Mapping[str, float], base: str) -> Iterator[str]:
    inertia = values[body.inertia]
    kind, axis = MOTION[body.motion]
    damping = sum(values[name] if name else 0.0 for name in body.viscous) / 2.0
    friction = sum(coulomb_of(body, values)) / 2.0
    offset = body.friction.offset if body.friction else None
    yield f'  <link name="{body.name}_link">'
    # a rotation has no mass of its own: its size has no effect on an axis through the centre
    yield f'    <inertial><mass value="{inertia!r}"/><origin xyz="0 0 0"/>'
    yield (
        f'      <inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )
    yield "  </link>"
    yield f'  <joint name="{body.name}" type="{kind}">'
    yield f'    <parent link="{base}"/><child link="{body.name}_link"/><axis xyz="{axis}"/>'
    yield f'    <dynamics damping="{damping!r}" friction="{friction!r}"/>'
    if kind == "prismatic":
        yield '    <limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>'
    yield "  </joint>"
    if offset and values[offset]:
        yield f"  {xml_comment(f'constant force against {body.name}: {offset} = {values[offset]!r}')}"
