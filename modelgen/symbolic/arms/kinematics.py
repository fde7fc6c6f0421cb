"""How every link moves: speeds and accelerations in its own frame, and what every joint contributes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from modelgen.spec.arms.arm import ArmSensor, ArmSpec, Joint
from modelgen.symbolic.arms.expressions.graph import ONE, ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.placements import Lengths, Placement, placement

#: Components along x, y, z of a frame.
Vector = tuple[Ref, Ref, Ref]
NONE: Vector = (ZERO, ZERO, ZERO)
Z: Vector = (ZERO, ZERO, ONE)
UNITS: tuple[Vector, Vector, Vector] = ((ONE, ZERO, ZERO), (ZERO, ONE, ZERO), Z)
#: Rows of the wrench that the base exerts on the arm, in the base's frame about its origin.
BASE_ROWS = ("base_fx", "base_fy", "base_fz", "base_nx", "base_ny", "base_nz")


@dataclass(frozen=True)
class Twist:
    """Motion of a link's frame, in that frame: rotation, and translation of its origin."""

    angular: Vector
    linear: Vector


@dataclass(frozen=True)
class LinkMotion:
    """Motion of one link, in its own frame.

    Attributes
    ----------
    axes
        Twist for a unit speed of every joint that carries the link, by the joint's name; for base rows also
        for a unit motion of the base along and about its axes.
    speed, acceleration
        Angular speed and acceleration; linear ones of the frame's origin. The acceleration is less gravity's.
    gradient
        The matrix U = [alpha]x + [omega]x [omega]x: a point at c is faster by U c than the origin.
    """

    axes: Mapping[str, Twist]
    speed: Twist
    acceleration: Twist
    gradient: tuple[Vector, Vector, Vector]


def link_motions(graph: Graph, spec: ArmSpec, base_rows: bool = False) -> dict[str, LinkMotion]:
    """Return the motion of every link, by the name of its joint."""
    gravity = [-graph.constant(component) for component in spec.gravity]
    still = Twist(NONE, NONE)
    axes = {}
    if base_rows:
        axes = dict(
            zip(BASE_ROWS, [Twist(NONE, u) for u in UNITS] + [Twist(u, NONE) for u in UNITS], strict=True)
        )
    base = LinkMotion(axes, still, Twist(NONE, (gravity[0], gravity[1], gravity[2])), (NONE, NONE, NONE))
    motions: dict[str, LinkMotion] = {}
    for joint in spec.joints:
        motions[joint.name] = _link_motion(
            graph, joint, base if joint.parent is None else motions[joint.parent]
        )
    return motions


def felt(graph: Graph, motion: LinkMotion, sensor: ArmSensor) -> Vector:
    """Return what a gyro or an accelerometer on a link reads along its own axes."""
    moved = _link_motion(graph, mounting_of(sensor), motion)
    return moved.speed.angular if sensor.measures == "gyro" else moved.acceleration.linear


def mounting_of(sensor: ArmSensor) -> Joint:
    """Return the mounting of a gyro or an accelerometer as a joint that does not move."""
    return Joint("", None, "fixed", sensor.mounting, ())


def _link_motion(graph: Graph, joint: Joint, parent: LinkMotion) -> LinkMotion:
    place = placement(joint)
    offset = offset_of(graph, place)
    axes = {name: _carried(graph, joint, place, offset, axis) for name, axis in parent.axes.items()}
    speed = _carried(graph, joint, place, offset, parent.speed)
    faster = tuple(graph.dot(row, offset) for row in parent.gradient)
    linear = plus(graph, parent.acceleration.linear, (faster[0], faster[1], faster[2]))
    angular = into_child(graph, joint, place, parent.acceleration.angular)
    linear = into_child(graph, joint, place, linear)
    if joint.kind == "fixed":
        moved = Twist(angular, linear)
        return LinkMotion(axes, speed, moved, _gradient(graph, speed.angular, angular))
    rate, rising = (graph.symbol(Symbol("position", joint.name, order)) for order in (1, 2))
    along = (ZERO, ZERO, rate)
    turning = cross(graph, speed.angular, along)
    if joint.kind == "revolute":
        axes[joint.name] = Twist(Z, NONE)
        speed = Twist(plus(graph, speed.angular, along), speed.linear)
        angular = plus(graph, plus(graph, angular, turning), (ZERO, ZERO, rising))
        return LinkMotion(axes, speed, Twist(angular, linear), _gradient(graph, speed.angular, angular))
    axes[joint.name] = Twist(NONE, Z)
    speed = Twist(speed.angular, plus(graph, speed.linear, along))
    gradient = _gradient(graph, speed.angular, angular)
    slid = graph.symbol(Symbol("position", joint.name))
    column = (gradient[0][2], gradient[1][2], gradient[2][2])
    linear = plus(graph, linear, scaled(graph, slid, column))
    linear = plus(graph, linear, plus(graph, turning, turning))
    linear = plus(graph, linear, (ZERO, ZERO, rising))
    return LinkMotion(axes, speed, Twist(angular, linear), gradient)


def _carried(graph: Graph, joint: Joint, place: Placement, offset: Vector, twist: Twist) -> Twist:
    """Return a twist of the parent's frame as one of the joint's frame."""
    angular = into_child(graph, joint, place, twist.angular)
    linear = plus(graph, twist.linear, cross(graph, twist.angular, offset))
    linear = into_child(graph, joint, place, linear)
    if joint.kind == "prismatic":
        slid = (ZERO, ZERO, graph.symbol(Symbol("position", joint.name)))
        linear = plus(graph, linear, cross(graph, angular, slid))
    return Twist(angular, linear)


def into_child(graph: Graph, joint: Joint, place: Placement, vector: Vector) -> Vector:
    """Return a vector of the parent's frame in the joint's frame as it is turned."""
    if vector == NONE:
        return NONE
    x, y, z = (
        graph.total(graph.scale(place.rotation[row][column], vector[row]) for row in range(3))
        for column in range(3)
    )
    if joint.kind != "revolute":
        return x, y, z
    cosine, sine = turned_by(graph, joint)
    return graph.dot((cosine, sine), (x, y)), graph.dot((-sine, cosine), (x, y)), z


def turned_by(graph: Graph, joint: Joint) -> tuple[Ref, Ref]:
    """Return cosine and sine of a joint's coordinate."""
    return graph.symbol(Symbol("cosine", joint.name)), graph.symbol(Symbol("sine", joint.name))


def offset_of(graph: Graph, place: Placement) -> Vector:
    """Return the offset of a placement as nodes, in the parent's frame."""
    x, y, z = (length_sum(graph, component) for component in place.offset)
    return x, y, z


def length_sum(graph: Graph, lengths: Lengths) -> Ref:
    """Return a sum of lengths as a node."""
    return graph.total(
        graph.scale(Fraction(factor), graph.symbol(Symbol("length", name)) if name else ONE)
        for name, factor in lengths.items()
    )


def plus(graph: Graph, left: Vector, right: Vector) -> Vector:
    """Return the sum of two vectors."""
    x, y, z = (graph.add(a, b) for a, b in zip(left, right, strict=True))
    return x, y, z


def scaled(graph: Graph, factor: Ref, vector: Vector) -> Vector:
    """Return a factor times a vector."""
    x, y, z = (graph.multiply(factor, component) for component in vector)
    return x, y, z


def cross(graph: Graph, left: Sequence[Ref], right: Sequence[Ref]) -> Vector:
    """Return the cross product of two vectors."""
    x, y, z = (
        graph.subtract(graph.multiply(left[a], right[b]), graph.multiply(left[b], right[a]))
        for a, b in ((1, 2), (2, 0), (0, 1))
    )
    return x, y, z


def _gradient(graph: Graph, omega: Vector, alpha: Vector) -> tuple[Vector, Vector, Vector]:
    """Return [alpha]x + [omega]x [omega]x, row by row."""
    (wx, wy, wz), (ax, ay, az) = omega, alpha
    times, add, less = graph.multiply, graph.add, graph.subtract
    xx, yy, zz = times(wx, wx), times(wy, wy), times(wz, wz)
    xy, xz, yz = times(wx, wy), times(wx, wz), times(wy, wz)
    return (
        (-add(yy, zz), less(xy, az), add(xz, ay)),
        (add(xy, az), -add(xx, zz), less(yz, ax)),
        (less(xz, ay), add(yz, ax), -add(xx, yy)),
    )
