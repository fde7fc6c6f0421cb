"""Small plots as SVG: lines on linear or logarithmic axes, stems, bars and a map of colours.

Colours come from the page's style sheet, so that a plot follows dark, light and print.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from modelgen.array_types import FloatArray

WIDTH, HEIGHT = 640, 250
LEFT, RIGHT, TOP, BOTTOM = 72, 14, 12, 42
NOTHING = Markup("")


@dataclass(frozen=True, eq=False)
class Line:
    """A line: `kind` is its colour (measured, rebuilt, residual), NaN a gap in it."""

    name: str
    kind: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True)
class Axis:
    """An axis from `low` to `high`, in the unit of what it shows; a logarithmic one in decades."""

    label: str
    low: float
    high: float
    logarithmic: bool = False

    def place(self, value: FloatArray) -> FloatArray:
        """Return where values lie, of the same shape: 0 at the low end of the axis, 1 at the high end."""
        if not self.logarithmic:
            return np.asarray((value - self.low) / (self.high - self.low))
        low, high = math.log10(self.low), math.log10(self.high)
        return np.asarray((np.log10(np.maximum(value, 1e-300)) - low) / (high - low))

    def ticks(self) -> list[float]:
        """Return round values within the axis."""
        if self.logarithmic:
            decades = range(math.ceil(math.log10(self.low)), math.floor(math.log10(self.high)) + 1)
            found = [10.0**k for k in decades]
            extra = [m * 10.0**k for k in range(decades.start - 1, decades.stop) for m in (2, 5)]
            within = [v for v in extra if self.low <= v <= self.high] if len(found) < 3 else []
            while len(found) > 7:
                found = found[::2]
            return sorted(found + within)
        span = self.high - self.low
        step = 10.0 ** math.floor(math.log10(span / 4.0))
        step *= next(m for m in (1, 2, 5, 10) if span / (m * step) <= 6.0)
        first = math.ceil(self.low / step - 1e-9)
        return [k * step for k in range(first, math.floor(self.high / step + 1e-9) + 1)]


def axis_for(label: str, values: Sequence[FloatArray], logarithmic: bool = False) -> Axis:
    """Return an axis, in their unit, for all finite (logarithmic: positive) values of arrays of any shape."""
    pooled = np.concatenate([np.ravel(v) for v in values]) if values else np.empty(0)
    pooled = pooled[np.isfinite(pooled) & ((pooled > 0.0) | (not logarithmic))]
    low, high = (float(pooled.min()), float(pooled.max())) if pooled.size else (0.1, 1.0)
    if logarithmic:
        return Axis(label, low / 1.1, high * 1.1, True)
    margin = 0.05 * (high - low) or 0.5 * abs(high) or 1.0
    return Axis(label, low - margin, high + margin)


def line_plot(
    x_axis: Axis,
    y_axis: Axis,
    lines: Sequence[Line],
    marks: Sequence[tuple[float, str]] = (),
    title: str = "",
    height: int = HEIGHT,
) -> Markup:
    """Return a plot of lines; `marks` are upright lines with a word."""
    parts = [_frame(x_axis, y_axis, height)]
    for place, (value, word) in enumerate(marks):
        if x_axis.low < value < x_axis.high:
            x = _x(x_axis, np.array([value]))[0]
            parts.append(Markup('<path class="mark" d="M{0} {1}V{2}"/>').format(_n(x), TOP, height - BOTTOM))
            parts.append(_text("marktext", x + 3, TOP + 10 + 12 * (place % 3), word, "start"))
    for line in lines:
        d = _path(_x(x_axis, line.x), _y(y_axis, line.y, height))
        if d:
            parts.append(Markup('<path class="line {0}" d="{1}"/>').format(line.kind, d))
    return _svg(title, parts, height)


def stem_plot(x_axis: Axis, y_axis: Axis, x: FloatArray, y: FloatArray, band: float, title: str) -> Markup:
    """Return a vertical line from zero for each value, and a band of +-`band`.

    x and y have shape (n,), in the units of their axes, the band that of y.
    """
    zero = float(_y(y_axis, np.array([0.0]), HEIGHT)[0])
    top, bottom = (float(_y(y_axis, np.array([v]), HEIGHT)[0]) for v in (band, -band))
    stems = "".join(
        f"M{_n(a)} {_n(zero)}V{_n(b)}" for a, b in zip(_x(x_axis, x), _y(y_axis, y, HEIGHT), strict=True)
    )
    parts = [
        _frame(x_axis, y_axis, HEIGHT),
        _rect("band", LEFT, top, WIDTH - LEFT - RIGHT, bottom - top),
        Markup('<path class="line residual" d="{}"/>').format(stems),
    ]
    return _svg(title, parts, HEIGHT)


def bar_plot(y_axis: Axis, values: FloatArray, names: Sequence[str], title: str) -> Markup:
    """Return one bar for each value, shape (n,), on a logarithmic axis of their unit."""
    x_axis = Axis("", 0.0, float(len(values)))
    parts = [_frame(x_axis, y_axis, HEIGHT, x_ticks=False)]
    base = HEIGHT - BOTTOM
    width = (WIDTH - LEFT - RIGHT) / max(len(values), 1)
    for index, (value, name) in enumerate(zip(values, names, strict=True)):
        top = float(_y(y_axis, np.array([value]), HEIGHT)[0])
        parts.append(_rect("bar", LEFT + width * (index + 0.2), top, 0.6 * width, max(base - top, 0.5)))
        parts.append(_text("tick", LEFT + width * (index + 0.5), base + 16, name, "middle"))
    return _svg(title, parts, HEIGHT)


def heat_map(names: Sequence[str], matrix: FloatArray, title: str) -> Markup:
    """Return a dimensionless matrix, -1 to 1, shape (n, n), as coloured squares with their numbers."""
    count = len(names)
    cell = max(26, min(58, 520 // max(count, 1)))
    left, top = 110, 30
    width, height = left + cell * count + 10, top + cell * count + 60
    parts = []
    for i, name in enumerate(names):
        parts.append(_text("tick", left - 6, top + cell * (i + 0.5) + 4, name, "end"))
        x, y = left + cell * (i + 0.5), top + cell * count + 12
        tilted = Markup(' transform="rotate(-35 {0} {1})"').format(_n(x), _n(y))
        parts.append(_text("tick", x, y, name, "end", tilted))
        for j in range(count):
            value = float(matrix[i, j])
            strength = _n(min(abs(value), 1.0))
            kind = "warm" if value > 0.0 else "cold"
            place = (left + cell * j, top + cell * i)
            parts.append(
                Markup(
                    '<rect class="cell {0}" fill-opacity="{1}" x="{2}" y="{3}" width="{4}" height="{4}"/>'
                ).format(kind, strength, place[0], place[1], cell - 1)
            )
            if cell >= 36:
                strong = " strong" if abs(value) > 0.55 else ""
                parts.append(
                    _text(
                        f"celltext{strong}",
                        place[0] + cell / 2,
                        place[1] + cell / 2 + 4,
                        f"{value:.2f}",
                        "middle",
                    )
                )
    return _svg(title, parts, height, width)


def interval_plot(x_axis: Axis, rows: Sequence[tuple[str, float, float, float]], title: str) -> Markup:
    """Return a row for each label, value and ends of its interval: a line with the value as a mark on it."""
    left, step = 170, 24
    height = TOP + step * len(rows) + BOTTOM

    parts = [_frame(x_axis, None, height, left=left)]
    for index, (name, *interval) in enumerate(rows):
        at, begin, end = map(_n, np.clip(_x(x_axis, np.array(interval), left), left - 10.0, WIDTH))
        y = TOP + step * (index + 0.5)
        shown = name if len(name) <= 24 else f"{name[:21]}..."
        parts.append(_text("tick", left - 6, y + 4, shown, "end"))
        line = Markup('<path class="line rebuilt" d="M{0} {1}H{2}M{3} {4}V{5}"/>')
        parts.append(line.format(begin, _n(y), end, at, _n(y - 5), _n(y + 5)))
    return _svg(title, parts, height)


def _frame(
    x_axis: Axis, y_axis: Axis | None, height: int, x_ticks: bool = True, left: float = LEFT
) -> Markup:
    parts = [_rect("frame", left, TOP, WIDTH - left - RIGHT, height - TOP - BOTTOM)]
    base = height - BOTTOM
    for value in x_axis.ticks() if x_ticks else ():
        x = float(_x(x_axis, np.array([value]), left)[0])
        parts.append(Markup('<path class="grid" d="M{0} {1}V{2}"/>').format(_n(x), TOP, base))
        parts.append(_text("tick", x, base + 15, _label(value), "middle"))
    parts.append(_text("label", (left + WIDTH - RIGHT) / 2, height - 6, x_axis.label, "middle"))
    if y_axis is None:
        return Markup("").join(parts)
    for value in y_axis.ticks():
        y = float(_y(y_axis, np.array([value]), height)[0])
        parts.append(Markup('<path class="grid" d="M{0} {1}H{2}"/>').format(LEFT, _n(y), WIDTH - RIGHT))
        parts.append(_text("tick", LEFT - 6, y + 4, _label(value), "end"))
    middle = (TOP + base) / 2
    turned = Markup(' transform="rotate(-90 14 {0})"').format(_n(middle))
    parts.append(_text("label", 14, middle, y_axis.label, "middle", turned))
    return Markup("").join(parts)


def _x(axis: Axis, values: FloatArray, left: float = LEFT) -> FloatArray:
    return np.asarray(left + axis.place(values) * (WIDTH - left - RIGHT))


def _y(axis: Axis, values: FloatArray, height: int) -> FloatArray:
    inside = np.clip(axis.place(values), -0.02, 1.02)
    return np.asarray(height - BOTTOM - inside * (height - TOP - BOTTOM))


def _path(x: FloatArray, y: FloatArray) -> str:
    text, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if not (math.isfinite(a) and math.isfinite(b)):
            pen = "M"
            continue
        text.append(f"{pen}{_n(a)} {_n(b)}")
        pen = "L"
    return "".join(text)


def _rect(kind: str, x: float, y: float, width: float, height: float) -> Markup:
    return Markup('<rect class="{0}" x="{1}" y="{2}" width="{3}" height="{4}"/>').format(
        kind, _n(x), _n(y), _n(width), _n(height)
    )


def _text(kind: str, x: float, y: float, text: str, anchor: str, more: Markup = NOTHING) -> Markup:
    return Markup('<text class="{0}" x="{1}" y="{2}" text-anchor="{3}"{5}>{4}</text>').format(
        kind, _n(x), _n(y), anchor, text, more
    )


def _svg(title: str, parts: Sequence[Markup], height: float, width: float = WIDTH) -> Markup:
    head = Markup('<svg viewBox="0 0 {0} {1}" style="max-width:{0}px" role="img"><title>{2}</title>').format(
        width, height, title
    )
    return head + Markup("").join(parts) + Markup("</svg>")


def _n(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _label(value: float) -> str:
    return f"{value:.6g}" if value else "0"
