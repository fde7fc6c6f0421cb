"""How freely a link can move, whatever the joints do: about one axis only, its origin at rest, not at all.

The few facts that decide which of a link's parameters no row can see, exact because they are found from the
rational constants of the arm and not from samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from modelgen.spec.arms.arm import Joint
from modelgen.symbolic.arms.placements import Matrix

#: Three components along the axes of a link's frame.
Direction = tuple[Any, Any, Any]


@dataclass(frozen=True)
class Freedom:
    """What is known of a link's motion, in its own frame.

    Attributes
    ----------
    turning
        It never turns, about one direction only, or about more.
    axis
        The direction that it turns about, if it is one.
    slides
        Directions that it slides along, as long as it does not turn.
    centre
        A point of the link that moves along `axis` only (if it turns about one) or rests, if there is one.
    gravity
        Gravity, as long as the link turns about one direction or none; what lies across the axis turns.
    """

    turning: Literal["never", "one", "many"]
    axis: Direction
    slides: tuple[Direction, ...]
    centre: Direction | None
    gravity: Direction

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        return self.turning == "never" and not self.slides

    @property
    def upright(self) -> bool:
        """Whether turning about the axis does not change where gravity points; also without gravity."""
        return self.turning != "many" and parallel(self.axis, self.gravity)


Z: Direction = (Fraction(0), Fraction(0), Fraction(1))
ZERO: Direction = (Fraction(0), Fraction(0), Fraction(0))


def freedom(joint: Joint, rotation: Matrix, offset: Direction, parent: Freedom) -> Freedom:
    """Return the freedom of a joint's link from its parent's.

    `offset` is the origin of the joint's frame in the parent's, `rotation` as `Placement` has it.
    """
    axis, gravity = (into_frame(rotation, vector) for vector in (parent.axis, parent.gravity))
    slides = tuple(into_frame(rotation, slide) for slide in parent.slides)
    turning, centre = parent.turning, parent.centre
    if centre is not None:
        x, y, z = (there - here for there, here in zip(centre, offset, strict=True))
        centre = into_frame(rotation, (x, y, z))
    if joint.kind == "prismatic":
        slides = (*slides, Z)
        if turning == "many" or (turning == "one" and not parallel(axis, Z)):
            centre = None
    elif joint.kind == "revolute" and turning == "never":
        turning, axis = "one", Z
        centre = ZERO if all(parallel(slide, Z) for slide in slides) else None
    elif joint.kind == "revolute" and turning == "one" and not parallel(axis, Z):
        turning = "many"
        centre = None if centre is None or slides else _crossing(centre, axis)
    elif joint.kind == "revolute" and centre is not None:
        centre = centre if parallel(centre, Z) else None
    return Freedom(turning, axis, slides, centre, gravity)


def _crossing(point: Direction, axis: Direction) -> Direction | None:
    """Return where a line through a point, not along z, meets the z axis."""
    if point[0] * axis[1] - point[1] * axis[0]:
        return None
    far = point[0] / axis[0] if axis[0] else point[1] / axis[1]
    return (Fraction(0), Fraction(0), point[2] - far * axis[2])


def into_frame(rotation: Matrix, vector: Sequence[Any]) -> Direction:
    """Return a vector of the parent's frame in the child's."""
    x, y, z = (sum(rotation[row][column] * vector[row] for row in range(3)) for column in range(3))
    return x, y, z


def parallel(left: Direction, right: Direction) -> bool:
    """Return whether one of them is a multiple of the other; zero is one of all."""
    return not any(left[a] * right[b] - left[b] * right[a] for a, b in ((0, 1), (0, 2), (1, 2)))


def base_freedom(gravity: Direction) -> Freedom:
    """Return that of the base, which never moves."""
    return Freedom("never", ZERO, (), None, gravity)
