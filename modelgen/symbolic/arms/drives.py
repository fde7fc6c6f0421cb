"""What drives and springs contribute to the rows of joints: rotor inertia, friction, offset, gain, stiffness.

Every joint has its own, which acts with the joint's speed. A motor that moves more than one joint has another
one, with `COUPLED` behind the parameter's name: it acts with the motor's speed, seen from the motor's own
joint, on every joint that the motor moves. Where a spring is between a joint's motor and its link, the motor
has a coordinate of its own, seen from the joint: drives move with that one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.spec.arms.parameters import COUPLED
from modelgen.symbolic.arms.expressions.graph import ONE, Graph, Ref, Symbol

Direction = Literal["sign", "forward", "backward"]


@dataclass(frozen=True)
class JointDrive:
    """The drive of a joint, or the motor of coupled ones.

    Attributes
    ----------
    joint
        Whose names its parameters have.
    speed_name
        Of its speed, in `Symbol.name` of directions.
    lever
        Speed of the drive per speed of every coordinate that it moves, by its name (`motor_coordinate`).
    suffix
        Ends the names of its parameters.
    """

    joint: Joint
    speed_name: str
    lever: tuple[tuple[str, Fraction], ...]
    suffix: str


def motor_coordinate(joint: Joint) -> str:
    """Return the name of the coordinate of a joint's motor: that of the joint itself without a spring."""
    return f"{joint.name} motor" if joint.elastic else joint.name


def coordinates(spec: ArmSpec) -> tuple[str, ...]:
    """Return the names of all coordinates: links of joints in their order, motors behind springs."""
    names = [joint.name for joint in spec.moving]
    return (*names, *(motor_coordinate(joint) for joint in spec.moving if joint.elastic))


def drives(spec: ArmSpec) -> Iterator[JointDrive]:
    """Yield the drive of every joint that moves, and behind each that of its motor if that is coupled."""
    for joint in spec.moving:
        yield JointDrive(joint, joint.name, ((motor_coordinate(joint), Fraction(1)),), "")
        lever = motor_lever(spec, joint)
        if len(lever) > 1:
            yield JointDrive(joint, joint.name + COUPLED, lever, COUPLED)


def motor_lever(spec: ArmSpec, joint: Joint) -> tuple[tuple[str, Fraction], ...]:
    """Return the speed of a joint's motor, seen from that joint, per speed of what it moves."""
    row = spec.transmission[spec.moving.index(joint)]
    moved = [
        (motor_coordinate(other), Fraction(ratio))
        for other, ratio in zip(spec.moving, row, strict=True)
        if ratio
    ]
    own = dict(moved).get(motor_coordinate(joint), moved[0][1])
    return tuple((name, ratio / own) for name, ratio in moved)


def gain_column(graph: Graph, spec: ArmSpec, joint: Joint) -> dict[str, Ref]:
    """Return the entries of a drive's gain in the rows of joints: the drive's signal, negative.

    Gain times signal is the force on the drive's own joint; it stands right of the sign of equality, so that
    the left side holds what is known: other forces, and a payload whose parameters are known.
    """
    signal = graph.symbol(Symbol("force", joint.name))
    return {moved: graph.scale(-ratio, signal) for moved, ratio in motor_lever(spec, joint)}


def drive_columns(graph: Graph, drive: JointDrive) -> Iterator[tuple[str, Ref]]:
    """Yield (parameter, what it is multiplied by) of a drive, at a lever of one."""
    joint = drive.joint
    if joint.rotor_inertia:
        yield joint.rotor_inertia + drive.suffix, moved_by(graph, drive, 2)
    for kind, suffix, sign in directions(joint):
        direction = direction_of(graph, drive, kind)
        if joint.viscous:
            speed = moved_by(graph, drive, 1)
            factor = speed if kind == "sign" else graph.multiply(direction, speed)
            yield joint.viscous + suffix + drive.suffix, factor
        if joint.coulomb:
            yield joint.coulomb + suffix + drive.suffix, sign * direction
    if joint.offset and not drive.suffix:
        yield joint.offset, ONE


def spring_columns(graph: Graph, joint: Joint) -> Iterator[tuple[str, Ref]]:
    """Yield (parameter, what it is multiplied by) of the torque that a spring hands to the link."""
    deflection, rate = (deflected(graph, joint, order) for order in (0, 1))
    if joint.stiffness:
        yield joint.stiffness, deflection
    if joint.damping:
        yield joint.damping, rate
    if joint.stiffness3:
        yield joint.stiffness3, graph.multiply(deflection, graph.multiply(deflection, deflection))


def deflected(graph: Graph, joint: Joint, order: int) -> Ref:
    """Return the deflection of a spring, motor less link, differentiated so many times."""
    return graph.subtract(
        graph.symbol(Symbol("position", motor_coordinate(joint), order)),
        graph.symbol(Symbol("position", joint.name, order)),
    )


def moved_by(graph: Graph, drive: JointDrive, order: int) -> Ref:
    """Return the position of a drive, differentiated so many times."""
    return graph.total(
        graph.scale(ratio, graph.symbol(Symbol("position", name, order))) for name, ratio in drive.lever
    )


def direction_of(graph: Graph, drive: JointDrive, of: Direction) -> Ref:
    """Return the sign of a drive's speed, or 1 while it moves forward or backward and else 0.

    The symbol is that of the speed's positive node (`speed_node`): that of -x is that of x, reversed.
    """
    if moved_by(graph, drive, 1) > 0:
        return graph.symbol(Symbol("direction", drive.speed_name, of=of))
    reverse: dict[Direction, Direction] = {"sign": "sign", "forward": "backward", "backward": "forward"}
    symbol = graph.symbol(Symbol("direction", drive.speed_name, of=reverse[of]))
    return -symbol if of == "sign" else symbol


def speed_node(graph: Graph, drive: JointDrive) -> Ref:
    """Return the speed of a drive, or its negative where that is the node: whose direction the symbol is."""
    return abs(moved_by(graph, drive, 1))


def directions(joint: Joint) -> tuple[tuple[Direction, str, int], ...]:
    """Return (direction, suffix of its parameters, sign of its Coulomb friction) of a joint's friction."""
    if joint.friction == "symmetric":
        return (("sign", "", 1),)
    return (("forward", "_plus", 1), ("backward", "_minus", -1))
