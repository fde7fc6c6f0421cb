"""Forces that links need at the joints, from where their frames stand: Newton and Euler, out and back.

Rows of a module hold where joints stand as numbers in their lines. What rows would hold if a link were
longer, or gravity along another direction, follows from the placements that the module lists beside them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.simulation.arms.mounted_sensors import PlacedJoint

#: Parameters of a link in the order that forces are computed from: inertia about the origin of its frame.
OF_LINK = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m")


@dataclass(frozen=True, eq=False)
class PlacedLinks:
    """Links of an arm.

    Attributes
    ----------
    joints : tuple of PlacedJoint
        Each behind its parent.
    parents : tuple of int
        Places of their parents; -1 for the base.
    gravity : array, shape (3,)
        Acceleration of gravity in the base's frame in m/s^2.
    names : tuple of tuple of str
        Of the parameters of each link, in the order of `OF_LINK`; empty of a link that has none.
    """

    joints: tuple[PlacedJoint, ...]
    parents: tuple[int, ...]
    gravity: FloatArray
    names: tuple[tuple[str, ...], ...]

    def links(self, values: Mapping[str, float]) -> FloatArray:
        """Return the parameters of each link in SI, shape (joints, 10), from values by name, others zero."""
        return np.array([[values.get(name, 0.0) for name in names] for names in self.names])

    def forces(self, links: FloatArray, motion: FloatArray) -> FloatArray:
        """Return what the joints that move exert on links in motion, shape (moving, N), in N m or N.

        Parameters
        ----------
        links : array, shape (joints, 10)
            Parameters of each link in SI (`OF_LINK`).
        motion : array, shape (3, moving, N)
            Positions, speeds and accelerations of the joints that move, in rad or m and s.
        """
        count, size = motion.shape[2], len(self.joints)
        still = np.zeros((3, count))
        base = (still, still, np.broadcast_to(-self.gravity[:, None], (3, count)))
        moved, ways, place = list[tuple[FloatArray, ...]](), list[_Way](), 0
        for joint, parent in zip(self.joints, self.parents, strict=True):
            own = motion[:, place] if joint.kind != "fixed" else np.zeros((3, count))
            place += joint.kind != "fixed"
            way = _Way.of(joint, own[0])
            moved.append(_moved(joint.kind, way, own, *(base if parent < 0 else moved[parent])))
            ways.append(way)
        wrenches = [_wrench(link, *motion_of) for link, motion_of in zip(links, moved, strict=True)]
        exerted = []
        for index in range(size - 1, -1, -1):
            force, moment = wrenches[index]
            kind, parent = self.joints[index].kind, self.parents[index]
            if kind != "fixed":
                exerted.append((force if kind == "prismatic" else moment)[2])
            if parent >= 0:
                force, moment = ways[index].back(force), ways[index].back(moment)
                before = wrenches[parent]
                wrenches[parent] = before[0] + force, before[1] + moment + _cross(ways[index].offset, force)
        return np.array(exerted[::-1])


@dataclass(frozen=True, eq=False)
class _Way:
    """From a parent's frame to a joint's: a fixed rotation, a turn about z, and an offset in the parent's."""

    rotation: FloatArray
    turn: tuple[FloatArray, FloatArray] | None
    offset: FloatArray

    @staticmethod
    def of(joint: PlacedJoint, position: FloatArray) -> _Way:
        """Return the way of a joint at positions, shape (N,)."""
        rotation, offset = joint.placement[:3, :3], np.repeat(joint.placement[:3, 3:], len(position), axis=1)
        if joint.kind == "prismatic":
            offset = offset + rotation[:, 2:] * position
        turn = (np.cos(position), np.sin(position)) if joint.kind == "revolute" else None
        return _Way(rotation, turn, offset)

    def ahead(self, vector: FloatArray) -> FloatArray:
        """Return vectors of the parent's frame, shape (3, N), in the joint's."""
        vector = self.rotation.T @ vector
        if self.turn is None:
            return vector
        (c, s), (x, y, z) = self.turn, vector
        return np.array([c * x + s * y, c * y - s * x, z])

    def back(self, vector: FloatArray) -> FloatArray:
        """Return vectors of the joint's frame, shape (3, N), in the parent's."""
        if self.turn is not None:
            (c, s), (x, y, z) = self.turn, vector
            vector = np.array([c * x - s * y, s * x + c * y, z])
        return np.asarray(self.rotation @ vector)


def placed_links(module: Any) -> PlacedLinks | None:
    """Return the links of a module of an arm; None where it does not list their placements."""
    if not hasattr(module, "PLACEMENTS") or not hasattr(module, "GRAVITY"):
        return None
    places = {one["name"]: place for place, one in enumerate(module.JOINTS)}
    frames = [np.vstack([np.array(frame), [0.0, 0.0, 0.0, 1.0]]) for frame in module.PLACEMENTS]
    joints = tuple(
        PlacedJoint(one["name"], one["kind"], frame) for one, frame in zip(module.JOINTS, frames, strict=True)
    )
    parents = tuple(-1 if one["parent"] is None else places[one["parent"]] for one in module.JOINTS)
    names = tuple(_names(module, one["name"]) for one in module.JOINTS)
    return PlacedLinks(joints, parents, np.array(module.GRAVITY), names)


def _names(module: Any, joint: str) -> tuple[str, ...]:
    """Return the names of a link's parameters in the order of `OF_LINK`; empty where it has none."""
    own = [name for name, role in module.ROLES.items() if role["bodies"] == (f"link {joint}",)]
    links = [name for name in own if module.ROLES[name]["role"] == "link"]
    # mx_1 begins with m as well
    kinds = {max((k for k in OF_LINK if one.startswith(k)), key=len, default=""): one for one in links}
    return tuple(kinds.get(kind, "") for kind in OF_LINK)


def _moved(
    kind: str, way: _Way, own: FloatArray, speed: FloatArray, rise: FloatArray, felt: FloatArray
) -> tuple[FloatArray, ...]:
    """Return speed and acceleration of a frame in that, (3, N) each, from those of its parent's, and its own.

    `speed` and `rise` are angular, `felt` is linear and less gravity; `own` are position, speed and
    acceleration of the joint, shape (3, N).
    """
    felt = way.ahead(felt + _cross(rise, way.offset) + _cross(speed, _cross(speed, way.offset)))
    speed, rise = way.ahead(speed), way.ahead(rise)
    if kind == "fixed":
        return speed, rise, felt
    across = np.array([speed[1] * own[1], -speed[0] * own[1], own[2]])
    if kind == "prismatic":
        return speed, rise, felt + across * np.array([[2.0], [2.0], [1.0]])
    return speed + np.array([np.zeros_like(own[1]), np.zeros_like(own[1]), own[1]]), rise + across, felt


def _wrench(
    link: FloatArray, speed: FloatArray, rise: FloatArray, felt: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return force and moment about its frame's origin that a link needs, shape (3, N) each."""
    xx, xy, xz, yy, yz, zz = link[:6]
    inertia, first = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), link[6:9, None]
    about = _cross(rise, first) + _cross(speed, _cross(speed, first))
    force = link[9] * felt + about
    return force, inertia @ rise + _cross(speed, inertia @ speed) + _cross(first, felt)


def _cross(left: FloatArray, right: FloatArray) -> FloatArray:
    (a, b, c), (x, y, z) = left, right
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])
