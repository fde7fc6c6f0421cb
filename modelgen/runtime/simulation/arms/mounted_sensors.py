"""What sensors of an arm read along its motion: encoders, tachometers, torques, gyros and accelerometers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.simulation.arms.arm_coordinates import reading_of
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion

INERTIAL = ("gyro", "accelerometer")


@dataclass(frozen=True, eq=False)
class PlacedJoint:
    """A joint on the way from the base: `placement`, shape (4, 4), is its frame at zero in that before it."""

    name: str
    kind: str
    placement: FloatArray


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
    lines = _link_motion(sensor, joints, q, v, a)[int(sensor.measures == "accelerometer")]
    return dict(zip(sensor.channels, lines, strict=True))


def _link_motion(
    sensor: MountedSensor, joints: Sequence[str], q: FloatArray, v: FloatArray, a: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return angular speed, and acceleration less gravity, of a sensor's frame in that, shape (3, N) each."""
    speed, rise = np.zeros((2, 3, q.shape[1]))
    felt = np.tile(-np.array(sensor.gravity, dtype=float)[:, None], q.shape[1])
    for joint in sensor.way:
        felt = felt + _carried(speed, rise, joint.placement[:3, 3, None])
        speed, rise, felt = (joint.placement[:3, :3].T @ one for one in (speed, rise, felt))
        if joint.kind == "fixed":
            continue
        place = joints.index(joint.name)
        rate = np.zeros_like(speed)
        rate[2] = v[place]
        if joint.kind == "prismatic":
            slid = np.zeros_like(speed)
            slid[2] = q[place]
            felt = felt + _carried(speed, rise, slid) + 2.0 * _cross(speed, rate)
            felt[2] += a[place]
            continue
        cosine, sine = np.cos(q[place]), np.sin(q[place])
        speed, rise, felt = (
            np.array([cosine * x + sine * y, cosine * y - sine * x, z]) for x, y, z in (speed, rise, felt)
        )
        rise = rise + _cross(speed, rate)
        rise[2] += a[place]
        speed = speed + rate
    return speed, felt


def _carried(speed: FloatArray, rise: FloatArray, arm: FloatArray) -> FloatArray:
    """Return how much faster the end of an arm is than its origin, shape (3, N), in m/s^2."""
    return _cross(rise, arm) + _cross(speed, _cross(speed, arm))


def _cross(left: FloatArray, right: FloatArray) -> FloatArray:
    return np.cross(left, np.broadcast_to(right, left.shape), axis=0)
