"""What sensors of an arm read along its motion: encoders, tachometers, torques, gyros and accelerometers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.simulation.arms.arm_coordinates import reading_of
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.placed_joint import (
    FrameMotion,
    JointWay,
    PlacedJoint,
    base_motion,
    moved_frame,
)

INERTIAL = ("gyro", "accelerometer")


@dataclass(frozen=True, eq=False)
class MountedSensor:
    """A sensor of an arm, by joint and side.

    Attributes
    ----------
    key, joint, side, measures, channels
        As the arm's file and the tables of modules have them.
    way : tuple of PlacedJoint
        Of a gyro or an accelerometer: the joints from the base to its link, and behind them its mounting as a
        fixed one.
    gravity : tuple of float
        Acceleration of gravity in the base's frame in m/s^2, which an accelerometer reads reversed.
    """

    key: str
    joint: str
    side: str
    measures: str
    channels: tuple[str, ...]
    way: tuple[PlacedJoint, ...] = ()
    gravity: tuple[float, ...] = (0.0, 0.0, 0.0)


def sensor_channels(
    plant: ArmPlant, sensors: Sequence[MountedSensor], motion: JointMotion
) -> dict[str, FloatArray]:
    """Return what sensors read without noise along a motion of the coordinates, shape (N,) each, in SI."""
    q, v, a = motion.q, motion.v, motion.a
    own = plant.coordinates
    found: dict[str, FloatArray] = {}
    torques = plant.spring_torques(q, v) if any(one.measures == "torque" for one in sensors) else {}
    for sensor in sensors:
        if sensor.measures in INERTIAL:
            found |= felt_channels(sensor, plant.joints, q, v, a)
        elif sensor.measures == "torque":
            found[sensor.key] = torques[sensor.joint]
        else:
            ratios = plant.model.module.TRANSMISSION
            read = reading_of(sensor.joint, sensor.side, ratios, own.joints, own.driven, len(own.names))
            found[sensor.key] = read @ {"position": q, "velocity": v, "acceleration": a}[sensor.measures]
    return found


def felt_channels(
    sensor: MountedSensor, joints: Sequence[str], q: FloatArray, v: FloatArray, a: FloatArray
) -> dict[str, FloatArray]:
    """Return what a gyro or an accelerometer reads without noise, shape (N,) each, in SI.

    `q`, `v`, `a` are positions, speeds and accelerations of the links of `joints`, shape (joints, N) or more.
    """
    frame = _link_motion(sensor, joints, np.array([q, v, a]))
    lines = frame.felt if sensor.measures == "accelerometer" else frame.speed
    return dict(zip(sensor.channels, lines, strict=True))


def _link_motion(sensor: MountedSensor, joints: Sequence[str], motion: FloatArray) -> FrameMotion:
    """Return the motion of a sensor's frame, from that of joints, shape (3, joints, N)."""
    found = base_motion(np.array(sensor.gravity, dtype=float), motion.shape[2])
    for joint in sensor.way:
        fixed = joint.kind == "fixed"
        own = np.zeros_like(motion[:, 0]) if fixed else motion[:, joints.index(joint.name)]
        found = moved_frame(joint.kind, JointWay.of(joint, own[0]), own, found)
    return found
