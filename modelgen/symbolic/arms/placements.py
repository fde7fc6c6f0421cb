"""Where a joint's frame lies in its parent's at q = 0: an exact rotation and an offset of named lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from modelgen.spec.arms.arm import Joint, Turn

Row = tuple[Fraction, Fraction, Fraction]
Matrix = tuple[Row, Row, Row]
#: A sum of lengths: the factor of every name; "" stands for 1 m.
Lengths = Mapping[str, Fraction]

IDENTITY: Matrix = (
    (Fraction(1), Fraction(0), Fraction(0)),
    (Fraction(0), Fraction(1), Fraction(0)),
    (Fraction(0), Fraction(0), Fraction(1)),
)


@dataclass(frozen=True)
class Placement:
    """`rotation` has the axes of the joint's frame, in the parent's frame, as its columns."""

    rotation: Matrix
    offset: tuple[Lengths, Lengths, Lengths]


def placement(joint: Joint) -> Placement:
    """Return the placement that the steps of a joint make, first to last."""
    rotation = IDENTITY
    offset: tuple[dict[str, Fraction], ...] = ({}, {}, {})
    for step in joint.placement:
        if isinstance(step, Turn):
            rotation = _turned(rotation, step)
            continue
        name = step.length.name or ""
        for sums, row in zip(offset, rotation, strict=True):
            moved = sums.get(name, Fraction(0)) + row[step.axis] * step.length.factor
            sums[name] = moved
            if not moved:
                del sums[name]
    return Placement(rotation, (offset[0], offset[1], offset[2]))


def _turned(rotation: Matrix, turn: Turn) -> Matrix:
    """Return the rotation followed by one about an axis of the frame as it stands."""
    a, b = (turn.axis + 1) % 3, (turn.axis + 2) % 3
    cosine, sine = turn.angle.cosine, turn.angle.sine
    turned = []
    for row in rotation:
        new = list(row)
        new[a] = row[a] * cosine + row[b] * sine
        new[b] = row[b] * cosine - row[a] * sine
        turned.append((new[0], new[1], new[2]))
    return turned[0], turned[1], turned[2]
