"""Origins and axes of a URDF -> steps; angles near a multiple of 90 degrees are that multiple."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from modelgen.number_expression import PI
from modelgen.spec.arms.angles import RIGHT_ANGLE_RAD, angle_of
from modelgen.spec.arms.arm import Length, Step, Turn
from modelgen.spec.arms.placements import X, Y, Z, inverse, origin_placement, simplified
from modelgen.spec.arms.urdf.attributes import Attributes, without_dust
from modelgen.spec.arms.urdf.xml_tree import Element

_NONE = (Fraction(0),) * 3
MOST_RADIANS = 1000  # a few turns are odd, hundreds are another unit
#: Of a joint that has no axis; so the format says.
USUAL_AXIS = (Fraction(1), Fraction(0), Fraction(0))
Numbers = tuple[Fraction, ...]


def origin_numbers(origin: Element | None, read: Attributes, of: str) -> tuple[Numbers, Numbers]:
    """Return xyz (m) and rpy (rad) of an origin, zeros where it says nothing."""
    xyz, rpy = (read.numbers(origin, key, _NONE, of) for key in ("xyz", "rpy"))
    if origin is not None and any(abs(angle) > MOST_RADIANS for angle in rpy):
        read.report(origin, of, f"has an angle beyond {MOST_RADIANS} rad", "give rpy in rad, within a turn")
        rpy = _NONE
    return without_dust(xyz), rpy


def turns(rpy: Sequence[Fraction]) -> tuple[Step, ...]:
    """Return the steps of roll, pitch and yaw (rad)."""
    return origin_placement((), [angle_of(angle * 180 / PI) for angle in rpy])


def placement(
    before: Sequence[Step], origin: Element | None, axis: Sequence[Step], read: Attributes, of: str
) -> tuple[Step, ...]:
    """Return the steps from the frame of a joint to that of the next.

    `before` leads from the link's frame of the first to its joint's frame, `axis` likewise of the next.
    """
    xyz, rpy = origin_numbers(origin, read, of)
    steps = origin_placement([Length(value) for value in xyz], ())
    return simplified([*inverse(before), *steps, *turns(rpy), *axis])


def axis_steps(joint: Element, read: Attributes, of: str) -> tuple[Step, ...]:
    """Return the steps from a link's frame to one with the same origin whose z is the joint's axis."""
    element = joint.first("axis")
    x, y, z = (float(value) for value in read.numbers(element, "xyz", USUAL_AXIS, of))
    size = math.hypot(x, y, z)
    if size == 0.0:
        read.report(element or joint, of, "has an axis without a direction", 'write for example xyz="0 0 1"')
        return ()
    near = RIGHT_ANGLE_RAD * size
    turned: list[tuple[int, float]] = [(Z, math.atan2(y, x)), (Y, math.atan2(math.hypot(x, y), z))]
    if abs(x) <= near:  # one turn is enough, and cancels that of a parallel axis before
        turned = [(X, -math.atan2(y, z))]
    elif abs(y) <= near:
        turned = [(Y, math.atan2(x, z))]
    return simplified(Turn(about, angle_of(Fraction(math.degrees(angle)))) for about, angle in turned)
