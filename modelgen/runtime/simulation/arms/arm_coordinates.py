"""Coordinates in which an arm moves, and how channels and rows of its module are made of them.

Of a rigid arm these are its joints; springs add the motors in front of them, seen from their joints. Rows of
the module are balances of a joint with its motor, or of a motor with its spring and of the link behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_channels import DRIVE, moving
from modelgen.runtime.model.model import Model

MOTOR = " motor"
SPRING, LINK = " spring", " link"
DEFLECTION, DEFLECTED, DRIVEN = " deflection", " deflected", " driven"


@dataclass(frozen=True, eq=False)
class ArmCoordinates:
    """Positions of links, then of the motors of elastic joints, in rad or m.

    Attributes
    ----------
    joints, forces : tuple of str
        Names of the joints that move, and keys of the forces of their drives.
    names : tuple of str
        Links by the name of their joint, motors with " motor" behind it.
    channels : tuple of str
        Positions that the module reads,
    reads : ndarray, shape (channels, names)
        as sums of the coordinates.
    balances : ndarray, shape (names, rows)
        Balances of the coordinates as sums of the module's rows.
    stiff : ndarray, shape (names, joints)
        Coordinates of a motion in which no spring deflects.
    driven : tuple of int
        Places of the coordinates that the drives push and their encoders see.
    rates : mapping of str to ndarray, shape (names,)
        Speeds that the module reads, as sums of those of the coordinates.
    """

    joints: tuple[str, ...]
    forces: tuple[str, ...]
    names: tuple[str, ...]
    channels: tuple[str, ...]
    reads: FloatArray
    balances: FloatArray
    stiff: FloatArray
    driven: tuple[int, ...]
    rates: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def elastic(self) -> bool:
        """Whether a joint has a spring."""
        return len(self.names) > len(self.joints)

    def seen_in(self, signals: Mapping[str, FloatArray]) -> FloatArray:
        """Return the coordinates that channels of a record give, shape (names, N)."""
        measured = np.array([signals[key] for key in self.channels], dtype=float)
        if np.array_equal(self.reads, np.eye(len(self.names))):
            return measured
        return np.asarray(np.linalg.pinv(self.reads) @ measured)


def joint_units(model: Model) -> dict[str, str]:
    """Return the joints that move: name to rad or m."""
    return {one["name"]: "m" if one["kind"] == "prismatic" else "rad" for one in moving(model.module)}


def arm_coordinates(model: Model) -> ArmCoordinates | None:
    """Return the coordinates in which an arm moves; None where its motion does not follow from its rows."""
    if not model.is_arm or model.by_power:
        return None
    joints, rows = tuple(joint_units(model)), [row.name for row in model.rows]
    forces = tuple(one.key for one in model.actuators if one.key.startswith(DRIVE))
    springs = [name for name in joints if name + SPRING in rows]
    if not {*rows} >= {name + LINK if name in springs else name for name in joints}:
        return None
    names = (*joints, *(name + MOTOR for name in springs))
    at = {name: place for place, name in enumerate(names)}
    driven = tuple(at.get(name + MOTOR, at[name]) for name in joints)
    reads = _reads(model, joints, driven, len(names))
    if reads is None or np.linalg.matrix_rank(np.array([*reads.values()])) < len(names):
        return None
    known = {f"{order}{key}" for order in ("", "d1_", "d2_") for key in reads}
    known |= {*model.loads, *(one.key for one in model.actuators)}
    sums: dict[str, dict[str, float]] = {
        name: {name + LINK if name in springs else name: 1.0} for name in joints
    }
    sums |= {name + MOTOR: {name + SPRING: 1.0} for name in springs}
    if len(forces) != len(joints) or not known >= {*model.module.SIGNALS}:
        return None
    return _assembled(joints, forces, driven, reads, rows, sums)


def coordinates_about_rest(model: Model) -> ArmCoordinates | None:
    """Return the coordinates of an elastic arm in all rows of its module, those that give positions included.

    For masses and springs about a posture: sensors need not see both sides. None where rows of motors hold
    several joints, payloads are carried, or gyros read speeds.
    """
    module = model.module
    if not model.is_arm or model.loads or model.by_power or not hasattr(module, "SENSORS"):
        return None
    joints, rows = tuple(joint_units(model)), list(module.ROWS)
    sprung = {role.bodies[0] for role in model.roles.values() if role.role == "stiffness"}
    springs = [name for name in joints if name in sprung]
    names = (*joints, *(name + MOTOR for name in springs))
    at = {name: place for place, name in enumerate(names)}
    driven = tuple(at.get(name + MOTOR, at[name]) for name in joints)
    if module.ROW_KIND == "motor" and np.count_nonzero(module.TRANSMISSION) > len(joints):
        return None
    usable = {row for row, times in zip(rows, module.DIFFERENTIATED, strict=True) if not times}
    felt = {one["joint"] for one in module.SENSORS if one["measures"] == "torque"}
    sums: dict[str, dict[str, float]] = {}
    for name in joints:
        found = _parted(name, name in springs, name in felt, usable)
        if found is None:
            return None
        sums |= found
    sums = {name: sums[name] for name in names}
    reads: dict[str, FloatArray] = {}
    rates: dict[str, FloatArray] = {}
    for one in module.SENSORS:
        if one["measures"] in ("position", "velocity"):
            read = reading_of(one["joint"], one["side"], module.TRANSMISSION, joints, driven, len(names))
            (reads if one["measures"] == "position" else rates)[one["key"]] = read
        elif one["measures"] == "gyro" and any(
            channel in module.SIGNALS and f"{one['key']} {channel[-1]}" not in rows
            for channel in one["channels"]
        ):
            return None
    forces = tuple(one.key for one in model.actuators if one.key.startswith(DRIVE))
    return replace(_assembled(joints, forces, driven, reads, rows, sums), rates=rates)


def _parted(name: str, sprung: bool, felt: bool, rows: Set[str]) -> dict[str, dict[str, float]] | None:
    """Return the balances of a joint's link and motor as sums of rows; None where these do not say them.

    `felt` joints have a measured torque between both, which their rows hold and sums of them do not.
    """
    if not sprung:
        total = {name: 1.0} | ({name + LINK: 1.0} if felt else {})
        return {name: total} if rows >= total.keys() else None
    given = next((name + end for end in (SPRING, DEFLECTION, DEFLECTED, DRIVEN) if name + end in rows), "")
    if felt:
        link, motor = {name + LINK: 1.0, given: -1.0}, {name: 1.0, given: 1.0}
    elif given == name + DRIVEN:
        link, motor = {given: 1.0}, {name: 1.0, given: -1.0}
    elif name + LINK in rows:
        link, motor = {name + LINK: 1.0}, {given: 1.0}
    else:
        link, motor = {name: 1.0, given: -1.0}, {given: 1.0}
    return {name: link, name + MOTOR: motor} if rows >= link.keys() | motor.keys() else None


def _assembled(
    joints: tuple[str, ...],
    forces: tuple[str, ...],
    driven: tuple[int, ...],
    reads: Mapping[str, FloatArray],
    rows: Sequence[str],
    sums: Mapping[str, Mapping[str, float]],
) -> ArmCoordinates:
    """Return the coordinates, whose balances are sums of rows by their names: links, then motors."""
    names = tuple(sums)
    balances = np.zeros((len(names), len(rows)))
    for place, of in enumerate(sums.values()):
        for row, factor in of.items():
            balances[place, rows.index(row)] = factor
    stiff = np.zeros((len(names), len(joints)))
    for place, motor in enumerate(driven):
        stiff[[place, motor], place] = 1.0
    return ArmCoordinates(
        joints, forces, names, tuple(reads), np.array([*reads.values()]), balances, stiff, driven
    )


def _reads(
    model: Model, joints: tuple[str, ...], driven: tuple[int, ...], size: int
) -> dict[str, FloatArray] | None:
    """Return what every channel is as a sum of coordinates; None where one is no position."""
    if not hasattr(model.module, "SENSORS"):
        return {f"q_{name}": one for name, one in zip(joints, np.eye(size), strict=True)}
    if hasattr(model.module, "ESTIMATED"):
        return None
    found = {}
    for sensor in model.module.SENSORS:
        if sensor["measures"] != "position":
            return None
        ratios = model.module.TRANSMISSION
        found[sensor["key"]] = reading_of(sensor["joint"], sensor["side"], ratios, joints, driven, size)
    return found


def reading_of(
    joint: str,
    side: str,
    transmission: Sequence[Sequence[float]],
    joints: tuple[str, ...],
    driven: tuple[int, ...],
    size: int,
) -> FloatArray:
    """Return what an encoder reads as a sum of coordinates, rad or m per one of each, shape (size,).

    At a motor it reads the turns of the motor itself, in front of its gear.
    """
    place, unit = joints.index(joint), np.eye(size)
    if side == "motor":
        return np.array(transmission[place], dtype=float) @ unit[list(driven)]
    return np.asarray(unit[driven[place]] - unit[place] if side == "deflection" else unit[place])


def follows(model: Model) -> bool:
    """Return whether the motion of an arm with rigid joints follows from its rows."""
    found = arm_coordinates(model)
    return found is not None and not found.elastic
