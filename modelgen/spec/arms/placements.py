"""Where the frame of a joint stands on the link that carries it: steps of a row, or of xyz and rpy.

Rows are those of Khalil and Kleinfinger (1986), gamma and b for branches of trees:
Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from modelgen.spec.arms.angles import reversed_angle, sum_of_angles
from modelgen.spec.arms.arm import Angle, Length, Shift, Step, Turn
from modelgen.spec.arms.lengths import sum_of_lengths

X, Y, Z = range(3)
#: Keys of a row in the order of their steps, with the axis of each; those of a branch first.
ROW_ANGLES, ROW_LENGTHS = ("gamma", "alpha", "theta"), ("b", "d", "r")
_ROW = (("gamma", Z), ("b", Z), ("alpha", X), ("d", X))
_ZERO = (("theta", Z), ("r", Z))

Matrix = tuple[tuple[Fraction, ...], ...]


def row_placement(given: Mapping[str, Angle | Length]) -> tuple[Step, ...]:
    """Return the steps of a row; keys that are left out count as zero."""
    return simplified(_steps(given, (*_ROW, *_ZERO)))


def origin_placement(
    xyz: Sequence[Length], rpy: Sequence[Angle], given: Mapping[str, Angle | Length] | None = None
) -> tuple[Step, ...]:
    """Return the steps of an origin as URDF states it: along x, y, z, then yaw, pitch and roll.

    `given` may hold theta and r: how far the joint stands from there where its coordinate is zero.
    """
    shifts = [Shift(axis, length) for axis, length in enumerate(xyz)]
    turns = [Turn(axis, angle) for axis, angle in reversed([*enumerate(rpy)])]
    return simplified([*shifts, *turns, *_steps(given or {}, _ZERO)])


def inverse(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return the steps that lead back."""
    return tuple(
        Turn(step.axis, reversed_angle(step.angle))
        if isinstance(step, Turn)
        else Shift(step.axis, Length(-step.length.factor, step.length.name))
        for step in reversed(steps)
    )


def simplified(steps: Iterable[Step]) -> tuple[Step, ...]:
    """Return the same motion without steps that do nothing, neighbours about or along one axis as one."""
    done: list[Step] = []
    for step in steps:
        joined = _joined(done[-1], step) if done else None
        if joined is not None:
            done[-1] = joined
        else:
            done.append(step)
        if _is_nothing(done[-1]):
            done.pop()
    return tuple(done)


def rotation_of(steps: Iterable[Step]) -> Matrix:
    """Return the rotation of the steps: coordinates after them -> coordinates before them."""
    columns: list[list[Fraction]] = [[Fraction(int(i == j)) for j in range(3)] for i in range(3)]
    for step in steps:
        if isinstance(step, Turn):
            one, two = (step.axis + 1) % 3, (step.axis + 2) % 3
            c, s = step.angle.cosine, step.angle.sine
            first, second = columns[one], columns[two]
            columns[one] = [c * a + s * b for a, b in zip(first, second, strict=True)]
            columns[two] = [c * b - s * a for a, b in zip(first, second, strict=True)]
    return tuple(zip(*columns, strict=True))


def _steps(given: Mapping[str, Angle | Length], keys: Iterable[tuple[str, int]]) -> list[Step]:
    steps: list[Step] = []
    for key, axis in keys:
        value = given.get(key)
        if isinstance(value, Angle):
            steps.append(Turn(axis, value))
        elif value is not None:
            steps.append(Shift(axis, value))
    return steps


def _joined(one: Step, other: Step) -> Step | None:
    if one.axis != other.axis:
        return None
    if isinstance(one, Turn) and isinstance(other, Turn):
        return Turn(one.axis, sum_of_angles(one.angle, other.angle))
    if isinstance(one, Shift) and isinstance(other, Shift):
        length = sum_of_lengths(one.length, other.length)
        return None if length is None else Shift(one.axis, length)
    return None


def _is_nothing(step: Step) -> bool:
    return step.angle.cosine == 1 if isinstance(step, Turn) else step.length.factor == 0
