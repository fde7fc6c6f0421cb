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
from modelgen.runtime.simulation.arms.placed_joint import (
    FrameMotion,
    JointWay,
    PlacedJoint,
    base_motion,
    cross,
    moved_frame,
)

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
        base = base_motion(self.gravity, count)
        moved, ways, place = list[FrameMotion](), list[JointWay](), 0
        for joint, parent in zip(self.joints, self.parents, strict=True):
            own = motion[:, place] if joint.kind != "fixed" else np.zeros((3, count))
            place += joint.kind != "fixed"
            ways.append(JointWay.of(joint, own[0]))
            moved.append(moved_frame(joint.kind, ways[-1], own, base if parent < 0 else moved[parent]))
        wrenches = [_wrench(link, frame) for link, frame in zip(links, moved, strict=True)]
        exerted = []
        for index in range(size - 1, -1, -1):
            force, moment = wrenches[index]
            kind, parent = self.joints[index].kind, self.parents[index]
            if kind != "fixed":
                exerted.append((force if kind == "prismatic" else moment)[2])
            if parent >= 0:
                force, moment = ways[index].back(force), ways[index].back(moment)
                before = wrenches[parent]
                wrenches[parent] = before[0] + force, before[1] + moment + cross(ways[index].offset, force)
        return np.array(exerted[::-1])


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


def _wrench(link: FloatArray, frame: FrameMotion) -> tuple[FloatArray, FloatArray]:
    """Return force and moment about its frame's origin that a link needs, shape (3, N) each."""
    speed, rise, felt = frame
    xx, xy, xz, yy, yz, zz = link[:6]
    inertia, first = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), link[6:9, None]
    about = cross(rise, first) + cross(speed, cross(speed, first))
    force = link[9] * felt + about
    return force, inertia @ rise + cross(speed, inertia @ speed) + cross(first, felt)
