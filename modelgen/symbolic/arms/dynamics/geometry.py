"""Where the links are: the direct geometric model, and Jacobians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol
from modelgen.symbolic.arms.kinematics import (
    NONE,
    UNITS,
    LinkMotion,
    Vector,
    cross,
    offset_of,
    plus,
    scaled,
    turned_by,
)
from modelgen.symbolic.arms.placements import placement

Rotation = tuple[Vector, Vector, Vector]


@dataclass(frozen=True)
class Pose:
    """A link's frame in the base's: its axes are the columns of `rotation` (row by row), and its origin."""

    rotation: Rotation
    origin: Vector


def link_poses(graph: Graph, spec: ArmSpec) -> dict[str, Pose]:
    """Return the pose of every link, by the name of its joint."""
    poses: dict[str, Pose] = {}
    for joint in spec.joints:
        parent = Pose(UNITS, NONE) if joint.parent is None else poses[joint.parent]
        place = placement(joint)
        origin = plus(graph, parent.origin, in_base(graph, parent.rotation, offset_of(graph, place)))
        x, y, z = (
            in_base(
                graph,
                parent.rotation,
                (
                    graph.constant(place.rotation[0][k]),
                    graph.constant(place.rotation[1][k]),
                    graph.constant(place.rotation[2][k]),
                ),
            )
            for k in range(3)
        )
        if joint.kind == "revolute":
            cosine, sine = turned_by(graph, joint)
            x, y = (
                plus(graph, scaled(graph, cosine, x), scaled(graph, sine, y)),
                plus(graph, scaled(graph, cosine, y), scaled(graph, -sine, x)),
            )
        elif joint.kind == "prismatic":
            origin = plus(graph, origin, scaled(graph, graph.symbol(Symbol("position", joint.name)), z))
        first, second, third = zip(x, y, z, strict=True)
        poses[joint.name] = Pose((first, second, third), origin)
    return poses


def in_base(graph: Graph, rotation: Rotation, vector: Sequence[Ref]) -> Vector:
    """Return a vector of a link's frame along the axes of the base; or the product of any matrix of 3 x 3."""
    x, y, z = (graph.dot(row, vector) for row in rotation)
    return x, y, z


def jacobian(
    graph: Graph, spec: ArmSpec, motion: LinkMotion, pose: Pose | None = None, point: Vector = NONE
) -> list[list[Ref]]:
    """Return the Jacobian of a point of a link, 6 rows: its speed and the link's angular speed, per joint.

    Parameters
    ----------
    graph, spec
        The arm.
    motion : LinkMotion
        That of the link, of `link_motions`.
    pose : Pose, optional
        That of the link: the rows are then along the base's axes, else along the link's own.
    point : (x, y, z)
        The point in the link's frame; its origin if not given.
    """
    columns: list[tuple[Vector, Vector]] = []
    for joint in spec.moving:
        axis = motion.axes.get(joint.name)
        linear, angular = (NONE, NONE) if axis is None else (axis.linear, axis.angular)
        linear = plus(graph, linear, cross(graph, angular, point))
        if pose is not None:
            linear, angular = (in_base(graph, pose.rotation, vector) for vector in (linear, angular))
        columns.append((linear, angular))
    rows = [[linear[k] for linear, _ in columns] for k in range(3)]
    return rows + [[angular[k] for _, angular in columns] for k in range(3)]
