"""A joint placed in the frame before it: how its frame moves with that one, and by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray


@dataclass(frozen=True, eq=False)
class PlacedJoint:
    """A joint on the way from the base: `placement`, shape (4, 4), is its frame at zero in that before it."""

    name: str
    kind: str
    placement: FloatArray


class FrameMotion(NamedTuple):
    """Angular speed and acceleration of a frame, and the linear one of its origin less gravity.

    In that frame, shape (3, N) each, in rad/s, rad/s^2 and m/s^2.
    """

    speed: FloatArray
    rise: FloatArray
    felt: FloatArray


@dataclass(frozen=True, eq=False)
class JointWay:
    """From a parent's frame to a joint's: a fixed rotation, a turn about z, and an offset in the parent's."""

    rotation: FloatArray
    turn: tuple[FloatArray, FloatArray] | None
    offset: FloatArray

    @staticmethod
    def of(joint: PlacedJoint, position: FloatArray) -> JointWay:
        """Return the way of a joint at positions, shape (N,), in rad or m."""
        rotation, offset = joint.placement[:3, :3], np.repeat(joint.placement[:3, 3:], len(position), axis=1)
        if joint.kind == "prismatic":
            offset = offset + rotation[:, 2:] * position
        turn = (np.cos(position), np.sin(position)) if joint.kind == "revolute" else None
        return JointWay(rotation, turn, offset)

    def ahead(self, vector: FloatArray) -> FloatArray:
        """Return vectors of the parent's frame, shape (3, N), in the joint's, in their unit."""
        vector = self.rotation.T @ vector
        if self.turn is None:
            return vector
        (c, s), (x, y, z) = self.turn, vector
        return np.array([c * x + s * y, c * y - s * x, z])

    def back(self, vector: FloatArray) -> FloatArray:
        """Return vectors of the joint's frame, shape (3, N), in the parent's, in their unit."""
        if self.turn is not None:
            (c, s), (x, y, z) = self.turn, vector
            vector = np.array([c * x - s * y, s * x + c * y, z])
        return np.asarray(self.rotation @ vector)


def base_motion(gravity: FloatArray, count: int) -> FrameMotion:
    """Return the motion of the base, which stands, at `count` samples; gravity in m/s^2, shape (3,)."""
    still = np.zeros((3, count))
    return FrameMotion(still, still, np.repeat(-gravity[:, None], count, axis=1))


def moved_frame(kind: str, way: JointWay, own: FloatArray, before: FrameMotion) -> FrameMotion:
    """Return the motion of a joint's frame from that of the frame before it, and the joint's own.

    `own` are position, speed and acceleration of the joint in rad or m and s, shape (3, N).
    """
    speed, rise, felt = before
    felt = way.ahead(felt + cross(rise, way.offset) + cross(speed, cross(speed, way.offset)))
    speed, rise = way.ahead(speed), way.ahead(rise)
    if kind == "fixed":
        return FrameMotion(speed, rise, felt)
    across = np.array([speed[1] * own[1], -speed[0] * own[1], own[2]])
    if kind == "prismatic":
        return FrameMotion(speed, rise, felt + across * np.array([[2.0], [2.0], [1.0]]))
    still = np.zeros_like(own[1])
    return FrameMotion(speed + np.array([still, still, own[1]]), rise + across, felt)


def cross(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return products of vectors, shape (3, N) each, or (3, 1), in the product of their units."""
    (a, b, c), (x, y, z) = left, right
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])
