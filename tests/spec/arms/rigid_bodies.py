"""The rigid motion of an arm from its description alone: what tests hold the description against."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.spec.arms.arm import ArmSpec, Shift, Step


def transform(step: Step, lengths: Mapping[str, float | None]) -> np.ndarray:
    """Return the motion of a step, shape (4, 4)."""
    result = np.eye(4)
    if isinstance(step, Shift):
        named = 1.0 if step.length.name is None else lengths[step.length.name]
        assert named is not None
        result[step.axis, 3] = float(step.length.factor) * named
        return result
    one, two = (step.axis + 1) % 3, (step.axis + 2) % 3
    c, s = float(step.angle.cosine), float(step.angle.sine)
    result[one, one] = result[two, two] = c
    result[two, one], result[one, two] = s, -s
    return result


def poses(arm: ArmSpec, q: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Return where the frame of every joint stands in that of the base, each of shape (4, 4)."""
    found: dict[str, np.ndarray] = {}
    for joint in arm.joints:
        pose = np.eye(4) if joint.parent is None else found[joint.parent]
        for step in joint.placement:
            pose = pose @ transform(step, arm.lengths)
        moved = np.eye(4)
        if joint.kind == "revolute":
            c, s = np.cos(q[joint.name]), np.sin(q[joint.name])
            moved[:2, :2] = [[c, -s], [s, c]]
        elif joint.kind == "prismatic":
            moved[2, 3] = q[joint.name]
        found[joint.name] = pose @ moved
    return found


def mass_matrix_and_weights(
    arm: ArmSpec, q: Mapping[str, float], values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mass matrix and the generalized forces that hold the arm against gravity."""
    found = poses(arm, q)
    moving = [joint.name for joint in arm.moving]
    kinds = {joint.name: joint.kind for joint in arm.joints}
    parents = {joint.name: joint.parent for joint in arm.joints}
    mass, weights = np.zeros((len(moving), len(moving))), np.zeros(len(moving))
    gravity = np.array([float(g) for g in arm.gravity])
    for joint in arm.joints:
        if not joint.link:
            continue
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = (values[name] for name in joint.link)
        here = found[joint.name]
        turned, origin = here[:3, :3], here[:3, 3]
        inertia = turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T
        moment = turned @ np.array([mx, my, mz])
        linear, angular = np.zeros((3, len(moving))), np.zeros((3, len(moving)))
        name: str | None = joint.name
        while name is not None:
            axis = found[name][:3, 2]
            if kinds[name] == "revolute":
                linear[:, moving.index(name)] = np.cross(axis, origin - found[name][:3, 3])
                angular[:, moving.index(name)] = axis
            elif kinds[name] == "prismatic":
                linear[:, moving.index(name)] = axis
            name = parents[name]
        cross = np.cross(moment, np.eye(3)).T  # cross @ v = moment x v
        mass += m * linear.T @ linear + angular.T @ inertia @ angular
        mass += angular.T @ cross @ linear + linear.T @ cross.T @ angular
        weights -= m * linear.T @ gravity + angular.T @ np.cross(moment, gravity)
    return mass, weights
