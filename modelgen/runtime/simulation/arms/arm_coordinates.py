"""Coordinates in which an arm moves, and how channels and rows of its module are made of them.

Of a rigid arm these are its joints; springs add the motors in front of them, seen from their joints. Rows of
the module are balances of a joint with its motor, or of a motor with its spring and of the link behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_channels import moving
from modelgen.runtime.model.model import Model

MOTOR = " motor"
SPRING, LINK = " spring", " link"


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
    """

    joints: tuple[str, ...]
    forces: tuple[str, ...]
    names: tuple[str, ...]
    channels: tuple[str, ...]
    reads: FloatArray
    balances: FloatArray
    stiff: FloatArray
    driven: tuple[int, ...]

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
    forces = tuple(one.key for one in model.actuators if one.key.startswith("tau_"))
    springs = [name for name in joints if name + SPRING in rows]
    names = (*joints, *(name + MOTOR for name in springs))
    at = {name: place for place, name in enumerate(names)}
    driven = tuple(at.get(name + MOTOR, at[name]) for name in joints)
    reads = _reads(model, joints, driven, len(names))
    if reads is None or np.linalg.matrix_rank(np.array([*reads.values()])) < len(names):
        return None
    known = {f"{order}{key}" for order in ("", "d1_", "d2_") for key in reads}
    known |= {*model.loads, *(one.key for one in model.actuators)}
    own = {name: name + LINK if name in springs else name for name in joints}
    if len(forces) != len(joints) or not {*rows} >= {*own.values()} or not known >= {*model.module.SIGNALS}:
        return None
    balances = np.zeros((len(names), len(rows)))
    for name in joints:
        balances[at[name], rows.index(own[name])] = 1.0
        if name in springs:
            balances[at[name + MOTOR], rows.index(name + SPRING)] = 1.0
    stiff = np.zeros((len(names), len(joints)))
    for place, name in enumerate(joints):
        stiff[[at[name], driven[place]], place] = 1.0
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
    """Return what an encoder reads as a sum of coordinates, shape (size,).

    At a motor it reads the turns of the motor itself, in front of its gear.
    """
    place, unit = joints.index(joint), np.eye(size)
    if side == "motor":
        return np.array(transmission[place], dtype=float) @ unit[list(driven)]
    return np.asarray(unit[driven[place]] - unit[place] if side == "deflection" else unit[place])


def follows(model: Model) -> bool:
    """Tell whether the motion of an arm with rigid joints follows from its rows."""
    found = arm_coordinates(model)
    return found is not None and not found.elastic
