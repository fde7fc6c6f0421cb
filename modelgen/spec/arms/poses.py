"""Where the frames of an arm stand while every coordinate is zero, in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.spec.arms.arm import ArmSpec, Shift, Step

#: Of a length that has no value (m).
SOME_LENGTH = 0.4


def pose_of(steps: Iterable[Step], lengths: Mapping[str, float | None]) -> FloatArray:
    """Return the frame behind steps in that before them, shape (4, 4), lengths in m."""
    pose: FloatArray = np.eye(4)
    for step in steps:
        pose = pose @ _motion(step, lengths)
    return pose


def zero_poses(arm: ArmSpec) -> dict[str, FloatArray]:
    """Return the frame of every joint in that of the base, shape (4, 4), lengths in m, by the joint."""
    return {name: frames[-1] for name, frames in zero_ways(arm).items()}


def zero_ways(arm: ArmSpec) -> dict[str, list[FloatArray]]:
    """Return the frames on the way to every joint: its parent's, and those after each step from there.

    Shape (4, 4) each, lengths in m.
    """
    ways: dict[str, list[FloatArray]] = {}
    for joint in arm.joints:
        frames: list[FloatArray] = [np.eye(4) if joint.parent is None else ways[joint.parent][-1]]
        for step in joint.placement:
            frames.append(frames[-1] @ _motion(step, arm.lengths))
        ways[joint.name] = frames
    return ways


def _motion(step: Step, lengths: Mapping[str, float | None]) -> FloatArray:
    motion: FloatArray = np.eye(4)
    if isinstance(step, Shift):
        named = lengths.get(step.length.name) if step.length.name else 1.0
        motion[step.axis, 3] = float(step.length.factor) * (SOME_LENGTH if named is None else named)
        return motion
    one, two = (step.axis + 1) % 3, (step.axis + 2) % 3
    cosine, sine = float(step.angle.cosine), float(step.angle.sine)
    motion[one, one] = motion[two, two] = cosine
    motion[two, one], motion[one, two] = sine, -sine
    return motion
