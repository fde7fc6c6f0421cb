"""The parameters of an arm: their names, what each stands for, and their SI units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec, Joint

ArmRole = Literal[
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
    "rotor_inertia", "viscous", "coulomb", "offset", "stiffness", "damping", "stiffness3", "gain",
]  # fmt: skip
DriveRole = Literal[
    "rotor_inertia", "viscous", "coulomb", "offset", "stiffness", "damping", "stiffness3", "gain"
]

#: Of the drive: key of a joint's table -> how the name of its parameter begins.
DRIVE_PREFIXES: dict[DriveRole, str] = {
    "rotor_inertia": "Ia",
    "viscous": "Fv",
    "coulomb": "Fs",
    "offset": "off",
    "stiffness": "K",
    "damping": "D",
    "stiffness3": "K3",
    "gain": "gain",
}
#: What a moving joint has besides its link where the file does not say it: the rigid model with friction.
USUAL_DRIVE: tuple[DriveRole, ...] = ("rotor_inertia", "viscous", "coulomb", "offset")
#: Ends the names of the parameters of a motor that moves more than one joint.
COUPLED = "_motor"
#: Values that nature does not have below zero.
NEVER_NEGATIVE = frozenset(
    {"Ixx", "Iyy", "Izz", "m", "rotor_inertia", "viscous", "coulomb", "stiffness", "damping"}
)
#: Of an elastic joint: the spring between its motor and its link.
SPRING: tuple[DriveRole, ...] = ("stiffness", "damping", "stiffness3")


@dataclass(frozen=True)
class ArmParameter:
    """A parameter: what it stands for, the joint whose link or drive it is of, and its unit.

    `of_motor`: of a motor that moves more than one joint, in place of the joint's own drive; `payload`: of
    which one, in place of the joint's link.
    """

    name: str
    role: ArmRole
    joint: str
    unit: str
    of_motor: bool = False
    payload: str | None = None


def link_names(joint: str) -> tuple[str, ...]:
    """Return the names of the ten parameters of the link behind a joint."""
    return tuple(f"{quantity}_{joint}" for quantity in LINK_PARAMETERS)


def arm_parameters(arm: ArmSpec) -> tuple[ArmParameter, ...]:
    """Return all parameters, known ones too: joint by joint, the link's, its drive's, a coupled motor's.

    Behind them are those of payloads.
    """
    coupled = coupled_motors(arm)
    own = (parameter for joint in arm.joints for parameter in _of(joint, joint.name in coupled))
    carried = (
        replace(one, payload=payload.name)
        for payload in arm.payloads
        for one in _of_link(payload.joint, payload.link)
    )
    return (*own, *carried)


def coupled_motors(arm: ArmSpec) -> frozenset[str]:
    """Return the joints whose motor moves more than one: it has inertia and friction of its own."""
    rows = zip(arm.moving, arm.transmission, strict=True)
    return frozenset(joint.name for joint, row in rows if sum(map(bool, row)) > 1)


def _of_link(joint: str, link: tuple[str, ...]) -> Iterator[ArmParameter]:
    for role, name in zip(LINK_PARAMETERS, link, strict=bool(link)):
        unit = {"m": "kg"}.get(role, "kg m" if role.startswith("m") else "kg m^2")
        yield ArmParameter(name, role, joint, unit)  # type: ignore[arg-type]


def _of(joint: Joint, coupled: bool) -> Iterator[ArmParameter]:
    yield from _of_link(joint.name, joint.link)
    units = _units(joint)
    for drive, named in _own_parts(joint):
        if named is not None:
            yield ArmParameter(named, drive, joint.name, units[drive])
    for drive, named in _of_drive(joint) if coupled else ():
        if named is not None:
            yield ArmParameter(named + COUPLED, drive, joint.name, units[drive], of_motor=True)


def _own_parts(joint: Joint) -> Iterator[tuple[DriveRole, str | None]]:
    yield from _of_drive(joint)
    yield "offset", joint.offset
    yield "stiffness", joint.stiffness
    yield "damping", joint.damping
    yield "stiffness3", joint.stiffness3
    yield "gain", joint.gain


def _of_drive(joint: Joint) -> Iterator[tuple[DriveRole, str | None]]:
    yield "rotor_inertia", joint.rotor_inertia
    for side in ("_plus", "_minus") if joint.friction == "asymmetric" else ("",):
        yield "viscous", joint.viscous and joint.viscous + side
        yield "coulomb", joint.coulomb and joint.coulomb + side


def _units(joint: Joint) -> dict[DriveRole, str]:
    turns = joint.kind != "prismatic"
    force, way = ("N m", "rad") if turns else ("N", "m")
    return {
        "rotor_inertia": "kg m^2" if turns else "kg",
        "viscous": f"{force} s/{way}",
        "coulomb": force,
        "offset": force,
        "stiffness": f"{force}/{way}",
        "damping": f"{force} s/{way}",
        "stiffness3": f"{force}/{way}^3",
        "gain": f"{force} per unit of its signal",
    }
