"""The parameters of an arm: their names, what each stands for, and their SI units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSensor, ArmSpec, Joint
from modelgen.spec.arms.poses import pose_of

ArmRole = Literal[
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
    "rotor_inertia", "viscous", "coulomb", "offset", "stiffness", "damping", "stiffness3", "gain", "mounting",
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


def arm_parameters(arm: ArmSpec, sensors: Sequence[ArmSensor] = ()) -> tuple[ArmParameter, ...]:
    """Return all parameters, known ones too: joint by joint, the link's, its drive's, a coupled motor's.

    Behind them are those of payloads, and of the mountings of sensors.
    """
    coupled = coupled_motors(arm)
    own = (parameter for joint in arm.joints for parameter in _of(joint, joint.name in coupled))
    carried = (
        replace(one, payload=payload.name)
        for payload in arm.payloads
        for one in _of_link(payload.joint, payload.link)
    )
    return (*own, *carried, *(one for sensor in sensors for one in mounting_parameters(sensor)))


def mounting_parameters(sensor: ArmSensor) -> Iterator[ArmParameter]:
    """Yield the parameters of a mounting that is to be found, axis by axis of the sensor.

    A gyro's axis reads the sum of R_KEY_x_j w_j: its direction cosines in the frame of the link (times its
    sensitivity). An accelerometer's reads the sum of R_KEY_x_j a_j + l_KEY_x_jk U_jk, where U is the gradient
    of the acceleration, and l_KEY_x_jk = R_KEY_x_j p_k for a sensor that stands at p.
    """
    for channel in sensor.channels if sensor.estimated else ():
        for along in "xyz":
            yield ArmParameter(f"R_{channel}_{along}", "mounting", sensor.joint, "1")
        for pair in product("xyz", repeat=2) if sensor.measures == "accelerometer" else ():
            yield ArmParameter(f"l_{channel}_{''.join(pair)}", "mounting", sensor.joint, "m")


def mounting_values(arm: ArmSpec, sensors: Sequence[ArmSensor]) -> dict[str, float]:
    """Return those parameters of sensors that are mounted as the file says."""
    found: dict[str, float] = {}
    for sensor in sensors:
        pose = pose_of(sensor.mounting, arm.lengths)
        cosines, lever = pose[:3, :3].T, pose[:3, 3]
        numbers = [
            float(value)
            for row in cosines
            for part in (row, *([np.outer(row, lever).ravel()] if sensor.measures == "accelerometer" else ()))
            for value in part
        ]
        names = [one.name for one in mounting_parameters(sensor)]
        found |= dict(zip(names, numbers, strict=bool(names)))
    return found


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
