"""Torques of the joints by the recursive equations of Newton and Euler, with parameters as symbols."""

from __future__ import annotations

from collections.abc import Collection

from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.symbolic.arms.drives import coordinates, drive_columns, drives, motor_coordinate, spring_columns
from modelgen.symbolic.arms.dynamics.geometry import in_base
from modelgen.symbolic.arms.expressions.graph import ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.kinematics import (
    NONE,
    LinkMotion,
    Vector,
    cross,
    link_motions,
    offset_of,
    plus,
    scaled,
    turned_by,
)
from modelgen.symbolic.arms.placements import Placement, placement

#: Force on a link, and torque about the origin of its frame.
Wrench = tuple[Vector, Vector]


def inverse_dynamics(graph: Graph, spec: ArmSpec, regrouped: Collection[str] = ()) -> dict[str, Ref]:
    """Return force or torque of every joint that moves: what its drive has to give, friction included.

    Where a spring is between motor and link there is one for each: that of the motor by the name of
    `motor_coordinate`, and that of the link, which is zero as long as nobody pushes it.

    Parameters
    ----------
    graph, spec
        The arm.
    regrouped : collection of str
        Parameters that are zero: those that depend on kept ones, whose symbols then stand for the base
        parameters. A six-axis arm then takes a sixth fewer operations.
    """
    motions = link_motions(graph, spec)
    carried: dict[str, Wrench] = {}
    torques: dict[str, Ref] = {}
    for joint in reversed(spec.joints):
        motion = motions[joint.name]
        force, torque = _link_wrench(graph, joint, motion, regrouped)
        if joint.name in carried:
            force, torque = (
                plus(graph, a, b) for a, b in zip((force, torque), carried[joint.name], strict=True)
            )
        if joint.kind != "fixed":
            torques[joint.name] = torque[2] if joint.kind == "revolute" else force[2]
        if joint.parent is not None:
            before = carried.get(joint.parent, (NONE, NONE))
            handed = _onto_parent(graph, joint, placement(joint), (force, torque))
            carried[joint.parent] = (plus(graph, before[0], handed[0]), plus(graph, before[1], handed[1]))
    names = coordinates(spec)
    torques |= {name: ZERO for name in names if name not in torques}
    _add_drives(graph, spec, torques, regrouped)
    _add_springs(graph, spec, torques, regrouped)
    return {name: torques[name] for name in names}


def _link_wrench(graph: Graph, joint: Joint, motion: LinkMotion, regrouped: Collection[str]) -> Wrench:
    """Return m a + U mc and I alpha + omega x (I omega) + mc x a of a link."""
    moment, mass = first_moment(graph, joint, regrouped)
    tensor = inertia(graph, joint, regrouped)
    linear, angular = motion.acceleration.linear, motion.acceleration.angular
    force = plus(graph, in_base(graph, motion.gradient, moment), scaled(graph, mass, linear))
    gyroscopic = cross(graph, motion.speed.angular, in_base(graph, tensor, motion.speed.angular))
    torque = plus(graph, in_base(graph, tensor, angular), gyroscopic)
    return force, plus(graph, torque, cross(graph, moment, linear))


def inertia(graph: Graph, joint: Joint, regrouped: Collection[str] = ()) -> tuple[Vector, Vector, Vector]:
    """Return the tensor of inertia of a joint's link about the origin of its frame, row by row."""
    if not joint.link:
        return NONE, NONE, NONE
    xx, xy, xz, yy, yz, zz = _parameters(graph, joint, regrouped)[:6]
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def first_moment(graph: Graph, joint: Joint, regrouped: Collection[str] = ()) -> tuple[Vector, Ref]:
    """Return m c and m of a joint's link."""
    if not joint.link:
        return NONE, 0
    x, y, z, mass = _parameters(graph, joint, regrouped)[6:]
    return (x, y, z), mass


def _parameters(graph: Graph, joint: Joint, regrouped: Collection[str]) -> list[Ref]:
    return [ZERO if name in regrouped else graph.symbol(Symbol("parameter", name)) for name in joint.link]


def _add_drives(graph: Graph, spec: ArmSpec, torques: dict[str, Ref], regrouped: Collection[str]) -> None:
    """Add what inertia and friction of the drives need."""
    for drive in drives(spec):
        for name, factor in drive_columns(graph, drive):
            if name in regrouped:
                continue
            value = graph.multiply(graph.symbol(Symbol("parameter", name)), factor)
            for joint, ratio in drive.lever:
                torques[joint] = graph.add(torques[joint], graph.scale(ratio, value))


def _add_springs(graph: Graph, spec: ArmSpec, torques: dict[str, Ref], regrouped: Collection[str]) -> None:
    """Add what springs take from motors and give to links."""
    for joint in (joint for joint in spec.moving if joint.elastic):
        for name, factor in spring_columns(graph, joint):
            if name not in regrouped:
                value = graph.multiply(graph.symbol(Symbol("parameter", name)), factor)
                motor = motor_coordinate(joint)
                torques[motor] = graph.add(torques[motor], value)
                torques[joint.name] = graph.subtract(torques[joint.name], value)


def _onto_parent(graph: Graph, joint: Joint, place: Placement, wrench: Wrench) -> Wrench:
    """Return a wrench about the joint's origin as one about the parent's, in the parent's frame."""
    force, torque = wrench
    if joint.kind == "prismatic":
        slid = (0, 0, graph.symbol(Symbol("position", joint.name)))
        torque = plus(graph, torque, cross(graph, slid, force))
    force, torque = (_into_parent(graph, joint, place, vector) for vector in (force, torque))
    return force, plus(graph, torque, cross(graph, offset_of(graph, place), force))


def _into_parent(graph: Graph, joint: Joint, place: Placement, vector: Vector) -> Vector:
    x, y, z = vector
    if joint.kind == "revolute":
        cosine, sine = turned_by(graph, joint)
        x, y = graph.dot((cosine, -sine), (x, y)), graph.dot((sine, cosine), (x, y))
    a, b, c = (
        graph.total(graph.scale(factor, ref) for factor, ref in zip(row, (x, y, z), strict=True))
        for row in place.rotation
    )
    return a, b, c
