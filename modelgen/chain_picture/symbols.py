"""The signs of a picture: spring, damper, gear, ground, force, sensor, each as a piece of SVG.

Every text goes through `text`, which escapes it; numbers are written with at most one decimal.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

LONGEST = 24  # letters of a name that are shown; the whole of it appears under the pointer
LETTER = 6.7  # width of one, 12 px high
GEAR = 44.0  # width of the sign of a ratio


def number(value: float) -> str:
    """Return a coordinate as SVG."""
    return f"{value:.1f}".removesuffix(".0")


def page(
    title: str, size: tuple[float, float], style: str, pieces: Sequence[str], alone: bool, widest: bool
) -> str:
    """Return a picture of a width and height; `alone` in a file of its own, `widest` grows no wider."""
    wide, high = map(number, size)
    space = 'xmlns="http://www.w3.org/2000/svg" ' if alone else ""
    head = f'<svg {space}class="chain" role="img" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}"'
    head += f' style="max-width:{wide}px">' if widest else ">"
    paper = f'<rect class="paper" width="{wide}" height="{high}"/>'
    above = (f"<title>{escape(title)}</title>", f"<style>{style}</style>", paper)
    return "\n".join([head, *above, *pieces, "</svg>", ""])


def shown(name: str) -> str:
    """Return names as they are shown: the middle of a long one is left out."""
    parts = name.split(", ")
    return ", ".join(p if len(p) <= LONGEST else f"{p[: LONGEST - 8]}…{p[-7:]}" for p in parts)


def width(name: str) -> float:
    """Return about how wide a name is drawn."""
    return LETTER * len(shown(name))


def text(x: float, y: float, name: str, kind: str = "name", anchor: str = "middle") -> str:
    """Return a text; `kind` is its class: name, strong, force, sensor or faint."""
    title = f"<title>{escape(name)}</title>" if shown(name) != name else ""
    place = f'x="{number(x)}" y="{number(y)}" text-anchor="{anchor}"'
    return f'<text class="{kind}" {place}>{title}{escape(shown(name))}</text>'


def path(points: list[tuple[float, float]], kind: str = "line") -> str:
    """Return a line through points."""
    steps = " ".join(f"{'L' if k else 'M'}{number(x)} {number(y)}" for k, (x, y) in enumerate(points))
    return f'<path class="{kind}" d="{steps}"/>'


def circle(x: float, y: float, radius: float, kind: str = "line") -> str:
    """Return a circle."""
    return f'<circle class="{kind}" cx="{number(x)}" cy="{number(y)}" r="{number(radius)}"/>'


def box(x: float, y: float, wide: float, high: float) -> str:
    """Return a body; x and y are its upper left corner."""
    size = f'width="{number(wide)}" height="{number(high)}"'
    return f'<rect class="body" x="{number(x)}" y="{number(y)}" {size} rx="6"/>'


def spring(left: float, right: float, y: float) -> str:
    """Return a zigzag between straight ends."""
    inner, ends = 0.6 * (right - left), 0.2 * (right - left)
    steps = 10
    zigzag = [(left + ends + inner * k / steps, y + (6.0 if k % 2 else -6.0)) for k in range(1, steps)]
    return path([(left, y), (left + ends, y), *zigzag, (right - ends, y), (right, y)])


def damper(left: float, right: float, y: float) -> str:
    """Return a piston in its cylinder."""
    middle = 0.5 * (left + right)
    cylinder = [(middle + 10.0, y - 6.0), (middle - 8.0, y - 6.0), (middle - 8.0, y + 6.0)]
    return "".join(
        (
            path([(left, y), (middle - 8.0, y)]),
            path([*cylinder, (middle + 10.0, y + 6.0)]),
            path([(middle + 3.0, y - 4.5), (middle + 3.0, y + 4.5)]),
            path([(middle + 3.0, y), (right, y)]),
        )
    )


def gear(x: float, y: float, ratio: str) -> str:
    """Return two wheels, GEAR wide from x on, with the ratio above them."""
    wheels = circle(x + 14.0, y, 7.0) + circle(x + 31.0, y, 10.0)
    ends = path([(x, y), (x + 7.0, y)]) + path([(x + 41.0, y), (x + GEAR, y)])
    return wheels + ends + text(x + 0.5 * GEAR, y - 16.0, f"{ratio} : 1", "faint")


def wall(x: float, y: float, side: float) -> str:
    """Return the ground as a vertical wall; `side` is +1 where its hatching is on the right of x."""
    hatches = [path([(x, y + k), (x + 8.0 * side, y + k + 8.0)], "thin") for k in range(-18, 18, 9)]
    return path([(x, y - 18.0), (x, y + 18.0)]) + "".join(hatches)


def floor(x: float, y: float, label: str) -> str:
    """Return the ground below a body, which rubs on it, with the names of what does."""
    hatches = [path([(x + k, y + 10.0), (x + k - 6.0, y + 17.0)], "thin") for k in range(-12, 15, 8)]
    stem = path([(x, y), (x, y + 10.0)]) + path([(x - 16.0, y + 10.0), (x + 16.0, y + 10.0)])
    return stem + "".join(hatches) + text(x, y + 31.0, label, "faint")


def force(x: float, y: float, label: str, anchor: str = "middle") -> str:
    """Return an arrow that ends at (x, y) from above, with its name."""
    arrow = path([(x, y - 24.0), (x, y - 2.0)], "force") + path(
        [(x - 4.0, y - 9.0), (x, y - 2.0), (x + 4.0, y - 9.0)], "force"
    )
    return arrow + text(x - 6.0 if anchor == "start" else x, y - 29.0, label, "forcename", anchor)
