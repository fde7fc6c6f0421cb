"""The picture of an arm from its description."""

from __future__ import annotations

from modelgen.chain_picture.arm_svg import ArmSkeleton, DrawnJoint, Point, arm_svg
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.poses import zero_ways


def draw_arm(arm: ArmSpec) -> str:
    """Return the picture of an arm as SVG: its joints and their axes where every coordinate is zero.

    A length that has a name and no value is drawn with 0.4 m.

    Examples
    --------
    >>> import modelgen
    >>> picture = modelgen.draw_arm(modelgen.load_arm("my_arm.toml"))  # doctest: +SKIP
    """
    return arm_svg(skeleton_of(arm))


def arm_section(arm: ArmSpec) -> str:
    """Return the picture as an element of the report."""
    return arm_svg(skeleton_of(arm), alone=False)


def skeleton_of(arm: ArmSpec) -> ArmSkeleton:
    """Return what the picture of an arm shows."""
    ways = {name: [frame.tolist() for frame in frames] for name, frames in zero_ways(arm).items()}
    joints = tuple(
        DrawnJoint(
            joint.name,
            joint.kind,
            tuple(_column(frame, 3) for frame in ways[joint.name]),
            _column(ways[joint.name][-1], 2),
        )
        for joint in arm.joints
    )
    return ArmSkeleton(arm.title, joints)


def _column(frame: list[list[float]], k: int) -> Point:
    return frame[0][k], frame[1][k], frame[2][k]
