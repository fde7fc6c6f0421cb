"""An arm as SVG: the skeleton of its joints, seen from above the corner between x and y of its base.

The text depends on nothing but the skeleton. Symbols: a drum turns about its length, a box slides along it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from modelgen.chain_picture.svg import STYLE
from modelgen.chain_picture.symbols import circle, number, page, path, shown, text, width

Point = tuple[float, float, float]
Place = tuple[float, float]

SIZE = 420.0  # of the longer side
MARGIN = 60.0
DRUM, THICK = 26.0, 9.0  # half the length and half the thickness of a joint
ARROW = 24.0  # of an axis, beyond its drum
NEAR = 14.0  # labels nearer than that stand side by side
OWN_STYLE = (
    ".chain path.bone{stroke-width:6;stroke-linecap:round;stroke:var(--c-faint)}"
    ".chain path.drum{fill:var(--c-body);stroke-width:1.6}"
    ".chain text.sensor{paint-order:stroke;stroke:var(--c-paper);stroke-width:4px}"
)
_COSINE, _SINE = math.cos(math.pi / 6), 0.5
_BASE = ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))


@dataclass(frozen=True)
class DrawnJoint:
    """A joint: points of the way to it from the joint before, or the base, and where its axis points."""

    name: str
    kind: str
    way: tuple[Point, ...]
    axis: Point

    @property
    def at(self) -> Point:
        """Where the joint stands."""
        return self.way[-1]


@dataclass(frozen=True)
class ArmSkeleton:
    """An arm at q = 0, in the frame of its base."""

    title: str
    joints: tuple[DrawnJoint, ...]


def arm_svg(skeleton: ArmSkeleton, alone: bool = True) -> str:
    """Return the picture; texts in it are escaped, and the same skeleton gives the same bytes.

    `alone` makes it a file of its own; without it, it is an element of a page.
    """
    every = [(0.0, 0.0), *(_flat(point) for joint in skeleton.joints for point in joint.way)]
    lower = [min(place[k] for place in every) for k in (0, 1)]
    upper = [max(place[k] for place in every) for k in (0, 1)]
    scale = SIZE / max(upper[0] - lower[0], upper[1] - lower[1], 1e-9)
    edge = MARGIN + DRUM + ARROW
    longest = max((width(_label(joint)) for joint in skeleton.joints), default=0.0)
    side = edge + max(longest, 40.0)

    def placed(point: Point) -> Place:
        x, y = _flat(point)
        return (side + scale * (x - lower[0]), edge + scale * (y - lower[1]))

    pieces = [_base(placed((0.0, 0.0, 0.0)))]
    for joint in skeleton.joints:
        way = [placed(point) for point in joint.way]
        if len({*way}) > 1:
            pieces.append(path(way, "bone"))
    places = [placed(joint.at) for joint in skeleton.joints]
    # slides behind the drums that stand on them
    drawn = sorted(zip(skeleton.joints, places, strict=True), key=lambda pair: pair[0].kind != "prismatic")
    pieces += [_symbol(joint, place) for joint, place in drawn]
    pieces += _labels(skeleton.joints, places)
    wide, high = 2 * side + scale * (upper[0] - lower[0]), 2 * edge + scale * (upper[1] - lower[1])
    pieces.append(_triad((40.0, high - 30.0)))
    return page(skeleton.title, (wide, high), STYLE + OWN_STYLE, pieces, alone, widest=not alone)


def _flat(point: Point) -> Place:
    """Return where a point is seen: x towards the left and down, y towards the right and down, z up."""
    x, y, z = point
    return (_COSINE * (y - x), _SINE * (x + y) - z)


def _symbol(joint: DrawnJoint, at: Place) -> str:
    if joint.kind == "fixed":
        return circle(*at, 4.0, "sensor")
    along = _flat(joint.axis)
    size = math.hypot(*along)
    thick = THICK * (1.7 if joint.kind == "prismatic" else 1.0)
    if size < 0.2:  # towards the eye
        return circle(*at, THICK, "body") + circle(*at, 2.0, "line")
    u = (along[0] / size, along[1] / size)
    across = (-u[1], u[0])
    half = DRUM * min(1.0, size)
    ends = [
        [_moved(at, u, 0.8 * s * half, across, t * thick) for s, t in corners]
        for corners in (((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)),)
    ]
    axis = [_moved(at, u, half, across, 0.0), _moved(at, u, half + ARROW, across, 0.0)]
    tip = axis[1]
    head = [_moved(tip, u, -7.0, across, 4.0), tip, _moved(tip, u, -7.0, across, -4.0)]
    body = path(ends[0], "drum") if joint.kind == "prismatic" else _drum(at, u, across, half)
    return path(axis, "sensor") + path(head, "sensor") + body


def _drum(at: Place, u: Place, across: Place, half: float) -> str:
    """Return a cylinder seen from the side: straight flanks, round ends."""
    a, b, c, d = (_moved(at, u, s * half, across, t * THICK) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    turn = number(math.degrees(math.atan2(u[1], u[0])))
    arc = f"A{number(0.4 * THICK)} {number(THICK)} {turn} 0"
    outline = f"M{_xy(a)} L{_xy(b)} {arc} 1 {_xy(c)} L{_xy(d)} {arc} 1 {_xy(a)} Z"
    inner = f"M{_xy(b)} {arc} 0 {_xy(c)}"
    return f'<path class="drum" d="{outline}"/><path class="line" d="{inner}"/>'


def _labels(joints: Sequence[DrawnJoint], places: Sequence[Place]) -> list[str]:
    """Return the names of joints next to the tips of their axes; those at one tip stand side by side."""
    tips: list[tuple[Place, bool, list[str]]] = []
    for joint, at in zip(joints, places, strict=True):
        along = _flat(joint.axis)
        size = math.hypot(*along)
        seen = joint.kind != "fixed" and size >= 0.2
        far = (min(1.0, size) * DRUM + ARROW) / size if seen else 0.0
        left = seen and along[0] < -0.3 * size
        tip = (at[0] + far * along[0] + (-8.0 if left else 8.0 if seen else 14.0), at[1] + far * along[1])
        near = next((names for other, _, names in tips if math.dist(other, tip) < NEAR), None)
        if near is None:
            tips.append((tip, left, [_label(joint)]))
        else:
            near.append(_label(joint))
    return [
        text(x, y + 4.0, ", ".join(names), "sensor", "end" if left else "start")
        for (x, y), left, names in tips
    ]


def _label(joint: DrawnJoint) -> str:
    return shown(joint.name if joint.kind == "fixed" else f"q_{joint.name}")


def _base(at: Place) -> str:
    corners = [_flat((24.0 * x, 24.0 * y, 0.0)) for x, y in (*_BASE, _BASE[0])]
    return path([(at[0] + x, at[1] + y) for x, y in corners], "drum")


def _triad(at: Place) -> str:
    pieces = []
    for axis, name in enumerate("xyz"):
        point = _flat((*(24.0 * (k == axis) for k in range(3)),))  # type: ignore[arg-type]
        end = (at[0] + point[0], at[1] + point[1])
        pieces.append(path([at, end], "thin"))
        pieces.append(text(at[0] + 1.4 * point[0], at[1] + 1.4 * point[1] + 4.0, name, "faint"))
    return "".join(pieces)


def _moved(at: Place, u: Place, along: float, across: Place, aside: float) -> Place:
    return (at[0] + along * u[0] + aside * across[0], at[1] + along * u[1] + aside * across[1])


def _xy(place: Place) -> str:
    return f"{number(place[0])} {number(place[1])}"
