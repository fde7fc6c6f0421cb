"""The parameters of an arm: their names, what each stands for, and their SI units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from modelgen.spec.arms.arm import LINK_PARAMETERS, Joint

ArmRole = Literal[
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
    "rotor_inertia", "viscous", "coulomb", "offset", "gain",
]  # fmt: skip
DriveRole = Literal["rotor_inertia", "viscous", "coulomb", "offset", "gain"]

#: Of the drive: key of a joint's table -> how the name of its parameter begins.
DRIVE_PREFIXES: dict[DriveRole, str] = {
    "rotor_inertia": "Ia",
    "viscous": "Fv",
    "coulomb": "Fs",
    "offset": "off",
    "gain": "gain",
}
#: What a moving joint has besides its link where the file does not say it: the rigid model with friction.
USUAL_DRIVE: tuple[DriveRole, ...] = ("rotor_inertia", "viscous", "coulomb", "offset")
#: Values that nature does not have below zero.
NEVER_NEGATIVE = frozenset({"Ixx", "Iyy", "Izz", "m", "rotor_inertia", "viscous", "coulomb"})


@dataclass(frozen=True)
class ArmParameter:
    """A parameter: what it stands for, the joint whose link or drive it is of, and its unit."""

    name: str
    role: ArmRole
    joint: str
    unit: str


def link_names(joint: str) -> tuple[str, ...]:
    """Return the names of the ten parameters of the link behind a joint."""
    return tuple(f"{quantity}_{joint}" for quantity in LINK_PARAMETERS)


def arm_parameters(joints: Iterable[Joint]) -> tuple[ArmParameter, ...]:
    """Return all parameters, known ones too: joint by joint, the link's before the drive's."""
    return tuple(parameter for joint in joints for parameter in _of(joint))


def _of(joint: Joint) -> Iterator[ArmParameter]:
    for role, name in zip(LINK_PARAMETERS, joint.link, strict=bool(joint.link)):
        unit = {"m": "kg"}.get(role, "kg m" if role.startswith("m") else "kg m^2")
        yield ArmParameter(name, role, joint.name, unit)  # type: ignore[arg-type]
    units = _units(joint)
    sides = ("_plus", "_minus") if joint.friction == "asymmetric" else ("",)
    named: list[tuple[DriveRole, str | None]] = [("rotor_inertia", joint.rotor_inertia)]
    for side in sides:
        named += [("viscous", joint.viscous and joint.viscous + side)]
        named += [("coulomb", joint.coulomb and joint.coulomb + side)]
    named += [("offset", joint.offset), ("gain", joint.gain)]
    for drive, named_so in named:
        if named_so is not None:
            yield ArmParameter(named_so, drive, joint.name, units[drive])


def _units(joint: Joint) -> dict[DriveRole, str]:
    turns = joint.kind != "prismatic"
    force = "N m" if turns else "N"
    return {
        "rotor_inertia": "kg m^2" if turns else "kg",
        "viscous": "N m s/rad" if turns else "N s/m",
        "coulomb": force,
        "offset": force,
        "gain": f"{force} per unit of the drive's signal",
    }
