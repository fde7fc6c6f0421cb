"""The inertial of a link, about its centre of mass -> the ten parameters about its joint's frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from modelgen.spec.arms.arm import LINK_PARAMETERS, Step, Turn
from modelgen.spec.arms.placements import Matrix, rotation_of
from modelgen.spec.arms.urdf.attributes import Attributes
from modelgen.spec.arms.urdf.origins import origin_numbers, turns
from modelgen.spec.arms.urdf.xml_tree import Element

_ZERO = Fraction(0)
_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def link_values(link: Element, axis: Sequence[Step], read: Attributes, of: str) -> dict[str, float] | None:
    """Return the ten parameters of a link (SI), exact but for the last rounding; None where it has no mass.

    `axis` leads from the link's frame, whose origin is that of the joint, to the joint's frame, whose z is
    its axis.
    """
    inertial = link.first("inertial")
    if inertial is None:
        return None
    mass = read.never_negative(inertial.first("mass"), "value", of)
    tensor = inertial.first("inertia")
    xx, xy, xz, yy, yz, zz = (read.number(tensor, key, of) or _ZERO for key in _ENTRIES)
    centre, rpy = origin_numbers(inertial.first("origin"), read, of)
    about_centre = _turned(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), rotation_of(turns(rpy)))
    square = sum(c * c for c in centre)
    about_origin = tuple(
        tuple(about_centre[i][j] + mass * (square * (i == j) - centre[i] * centre[j]) for j in range(3))
        for i in range(3)
    )
    back = _transposed(rotation_of(step for step in axis if isinstance(step, Turn)))
    inertia = _turned(about_origin, back)
    moment = [mass * sum(b * c for b, c in zip(row, centre, strict=True)) for row in back]
    upper = [inertia[i][j] for i in range(3) for j in range(i, 3)]
    return dict(zip(LINK_PARAMETERS, map(float, _rounded([*upper, *moment, mass])), strict=True))


def _rounded(values: Sequence[Fraction]) -> Iterator[Fraction]:
    """Return values, those that are rounding errors of rotations, relative to the largest, as zero."""
    largest = max(abs(value) for value in values)
    return (value if abs(value) > largest / 10**15 else _ZERO for value in values)


def _turned(tensor: Sequence[Sequence[Fraction]], rotation: Matrix) -> Matrix:
    return _product(_product(rotation, tensor), _transposed(rotation))


def _product(left: Sequence[Sequence[Fraction]], right: Sequence[Sequence[Fraction]]) -> Matrix:
    columns = _transposed(right)
    return tuple(
        tuple(sum((a * b for a, b in zip(row, col, strict=True)), _ZERO) for col in columns) for row in left
    )


def _transposed(matrix: Sequence[Sequence[Fraction]]) -> Matrix:
    return tuple(zip(*matrix, strict=True))
