"""A chain as SVG: bodies in the rows of their branches, a long chain in several lines, light and dark.

The text depends on nothing but the diagram. Its style sheet is its own: it may stand alone or in a page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modelgen.chain_picture.diagram import ChainDiagram, DrawnBody, DrawnDeflection, DrawnLink
from modelgen.chain_picture.symbols import (
    GEAR,
    box,
    circle,
    damper,
    floor,
    force,
    gear,
    page,
    path,
    spring,
    text,
    wall,
    width,
)
from modelgen.chain_picture.tree import TreeNode, branches

COLUMNS = 5  # bodies side by side before a chain goes on in the next line
HIGH = 46.0  # of a body
BELOW = 42.0  # for friction
LABEL = 15.0  # height of a line of text
MARGIN = 16.0
LANE = 14.0  # between lines that go around
STYLE = (
    ".chain{--c-paper:#fff;--c-ink:#1b1f24;--c-faint:#5b6673;--c-body:#eef1f4;--c-force:#c2410c;"
    "--c-sensor:#0b5cad}"
    "@media(prefers-color-scheme:dark){.chain{--c-paper:#14181d;--c-ink:#e4e8ec;--c-faint:#9aa5b1;"
    "--c-body:#232b34;--c-force:#ff8a4c;--c-sensor:#58a6ff}}"
    "@media print{.chain{--c-paper:#fff;--c-ink:#000;--c-faint:#444;--c-body:#fff;--c-force:#c2410c;"
    "--c-sensor:#0b5cad}}"
    '.chain text{font:12px system-ui,"DejaVu Sans",sans-serif;fill:var(--c-ink)}'
    ".chain text.strong{font-weight:600;font-size:14px}.chain text.faint{fill:var(--c-faint)}"
    ".chain text.forcename{fill:var(--c-force)}.chain text.sensor{fill:var(--c-sensor)}"
    ".chain .paper{fill:var(--c-paper)}.chain .body{fill:var(--c-body);stroke:var(--c-ink);stroke-width:1.4}"
    ".chain path,.chain circle{fill:none;stroke:var(--c-ink);stroke-width:1.4;stroke-linejoin:round}"
    ".chain .thin{stroke:var(--c-faint);stroke-width:1}.chain .force{stroke:var(--c-force);stroke-width:2}"
    ".chain path.sensor{stroke:var(--c-sensor)}.chain circle.sensor{stroke:none;fill:var(--c-sensor)}"
)


@dataclass(frozen=True)
class _Grid:
    """Widths of bodies and links, height of a row, and where nodes are."""

    body: float
    link: float
    row: float
    places: dict[int, tuple[float, float]]
    bands: dict[int, int]
    floors: tuple[float, ...]
    wide: float

    def left(self, node: TreeNode) -> float:
        return self.places[id(node)][0]

    def right(self, node: TreeNode) -> float:
        return self.left(node) + (0.0 if node.is_ground else self.body)

    def y(self, node: TreeNode) -> float:
        """Return the height of a body's middle."""
        return self.places[id(node)][1]


def chain_svg(diagram: ChainDiagram, alone: bool = True) -> str:
    """Return the picture; texts in it are escaped, and the same diagram gives the same bytes.

    `alone` makes it a file of its own; without it, it is an element of a page.
    """
    nodes, loops = branches(diagram)
    grid = _grid(diagram, nodes)
    by_name = {node.name: node for node in nodes if not node.is_ground}
    pieces = [_link(grid, node, node.parent, node.up) for node in nodes if node.parent and node.up]
    around: list[DrawnLink | DrawnDeflection] = [*loops]
    for sensor in diagram.deflections:
        pair = (by_name[sensor.first], by_name[sensor.second])
        child = next((a for a, b in (pair, pair[::-1]) if a.parent is b), None)
        if child is None:
            around.append(sensor)
        else:
            pieces.append(_deflection(grid, child, sensor))
    bottom, wide = grid.floors[-1], grid.wide
    for item in around:
        bottom += 3.0 * LANE
        piece, right = _around(grid, by_name[item.first], by_name[item.second], bottom, item)
        pieces.append(piece)
        wide = max(wide, right + MARGIN)
    bodies = {body.name: body for body in diagram.bodies}
    pieces += [_body(grid, node, bodies[node.name]) for node in by_name.values()]
    high = bottom + (2.0 * LANE if around else 0.0)
    return page(diagram.title, (wide, high), STYLE, pieces, alone, widest=True)


def _grid(diagram: ChainDiagram, nodes: Sequence[TreeNode]) -> _Grid:
    body = max([96.0, *map(_body_width, diagram.bodies)])
    sensed = [width(_reading(sensor.key, sensor.measures)) + 36.0 for sensor in diagram.deflections]
    link = max([112.0, *map(_link_width, diagram.links), *sensed])
    lines = max(len(entry.sensors) for entry in diagram.bodies)
    above = max(38.0, 14.0 + LABEL * lines)
    row = above + HIGH + BELOW
    bands = {id(node): node.depth // COLUMNS for node in nodes}
    rows = sorted({(bands[id(node)], node.row) for node in nodes})
    crossings: dict[int, int] = {}
    for node in nodes:
        if node.parent and bands[id(node)] != bands[id(node.parent)]:
            crossings[bands[id(node)]] = crossings.get(bands[id(node)], 0) + 1
    tops, floors, top = {}, list[float](), MARGIN
    for k, (band, line) in enumerate(rows):
        if k and band != rows[k - 1][0]:
            floors.append(top)
            top += LANE * (crossings[band] + 1)
        tops[band, line] = top
        top += row
    wraps = len(floors) > 0
    places = {}
    for node in nodes:
        band = bands[id(node)]
        x = MARGIN + (link if wraps else 0.0) + (node.depth % COLUMNS) * (body + link)
        places[id(node)] = (x, tops[band, node.row] + above + 0.5 * HIGH)
    used = max(x + (10.0 if node.is_ground else body) for node in nodes for x in (places[id(node)][0],))
    return _Grid(body, link, row, places, bands, (*floors, top), used + MARGIN + (LANE * wraps))


def _body_width(body: DrawnBody) -> float:
    sensors = max((width(_reading(*sensor)) for sensor in body.sensors), default=0.0)
    forces = width(body.actuator) + 18.0 if body.actuator else 0.0
    below = width(_rubbing(body))
    return max(forces + sensors + 22.0, width(body.name) * 1.2 + 16.0, width(body.inertia) + 16.0, below)


def _link_width(link: DrawnLink) -> float:
    longest = max(width(", ".join(link.springs)), width(link.damping or ""))
    return max(112.0, longest + 36.0) + _gear_room(link)


def _gear_room(link: DrawnLink) -> float:
    return max(GEAR, width(f"{link.ratio} : 1") + 6.0) if link.ratio else 0.0


def _reading(key: str, measures: str) -> str:
    return f"{key} {measures}"


def _rubbing(body: DrawnBody) -> str:
    constant = (f"constant {body.offset}",) if body.offset else ()
    return ", ".join((*body.friction, *constant))


def _body(grid: _Grid, node: TreeNode, body: DrawnBody) -> str:
    left, middle = grid.left(node), grid.y(node)
    top, centre = middle - 0.5 * HIGH, left + 0.5 * grid.body
    pieces = [box(left, top, grid.body, HIGH)]
    pieces += [text(centre, middle - 3.0, body.name, "strong"), text(centre, middle + 14.0, body.inertia)]
    if body.friction:
        pieces.append(floor(centre, middle + 0.5 * HIGH, _rubbing(body)))
    elif body.offset:
        pieces.append(text(centre, middle + 0.5 * HIGH + LABEL, _rubbing(body), "faint"))
    if body.actuator:
        pieces.append(force(left + 14.0, top, body.actuator, "start"))
    x = left + grid.body - 12.0
    for k, sensor in enumerate(body.sensors):
        y = top - 10.0 - LABEL * k
        pieces.append(circle(x, y, 3.5, "sensor"))
        pieces.append(text(x - 8.0, y + 4.0, _reading(*sensor), "sensor", "end"))
    if body.sensors:
        pieces.append(path([(x, top), (x, top - 10.0 - LABEL * (len(body.sensors) - 1))], "sensor"))
    return "".join(pieces)


def _link(grid: _Grid, node: TreeNode, parent: TreeNode, link: DrawnLink) -> str:
    """Return the link from a node to its parent, whose row, or line of the picture, may be another."""
    start, end = (grid.right(parent), grid.y(parent)), (grid.left(node), grid.y(node))
    inner = end[0] - grid.link + 10.0
    if grid.bands[id(node)] != grid.bands[id(parent)]:
        band = grid.bands[id(node)]
        fellows = [n for n in parent.children if grid.bands[id(n)] == band]
        lane = grid.floors[band - 1] + LANE * (1 + fellows.index(node))
        out = grid.wide - 0.6 * MARGIN
        route = [start, (out, start[1]), (out, lane), (inner, lane), (inner, end[1])]
    elif start[1] != end[1]:
        route = [start, (inner, start[1]), (inner, end[1])]
    else:
        route = [start, (inner, end[1])]
    sign = wall(end[0], end[1], 1.0) if node.is_ground else ""
    return path(route) + _elements(inner, end[0], end[1], link, link.first == parent.name) + sign


def _elements(left: float, right: float, y: float, link: DrawnLink, first_left: bool) -> str:
    """Return spring, damper and gear of a link; the gear is at the side of its first body."""
    pieces = []
    if link.ratio:
        room = _gear_room(link)
        begin, spare = left if first_left else right - room, 0.5 * (room - GEAR)
        pieces.append(gear(begin + spare, y, link.ratio))
        if spare:
            pieces += [path([(x, y), (x + spare, y)]) for x in (begin, begin + room - spare)]
        left, right = (left + room, right) if first_left else (left, right - room)
    name = ", ".join(link.springs)
    middle = 0.5 * (left + right)
    if not link.damping:
        return "".join([*pieces, spring(left, right, y), text(middle, y - 12.0, name)])
    inside = (left + 6.0, right - 6.0)
    for end, bar in ((left, inside[0]), (right, inside[1])):
        pieces += [path([(end, y), (bar, y)]), path([(bar, y - 10.0), (bar, y + 10.0)])]
    pieces += [spring(*inside, y - 10.0), damper(*inside, y + 10.0)]
    pieces += [text(middle, y - 22.0, name), text(middle, y + 30.0, link.damping)]
    return "".join(pieces)


def _deflection(grid: _Grid, child: TreeNode, sensor: DrawnDeflection) -> str:
    """Return a sensor of the deflection of the link to a child, below that link."""
    right, y = grid.left(child) - 3.0, grid.y(child) + 40.0
    left = right - grid.link + 16.0
    ends = [path([(x, y - 5.0), (x, y + 5.0)], "sensor") for x in (left, right)]
    label = text(0.5 * (left + right), y + LABEL, _reading(sensor.key, sensor.measures), "sensor")
    return path([(left, y), (right, y)], "sensor") + "".join(ends) + label


def _around(
    grid: _Grid, one: TreeNode, other: TreeNode, lane: float, item: DrawnLink | DrawnDeflection
) -> tuple[str, float]:
    """Return what ties two bodies that do not stand side by side: a line below all of them, and its end."""
    kind = "sensor" if isinstance(item, DrawnDeflection) else "line"
    ends = []
    for node in (one, other):
        x, y = grid.right(node), grid.y(node) + 0.25 * HIGH
        ends.append([(x, y), (x + 5.0, y), (x + 5.0, lane)])
    swapped = ends[0][-1][0] > ends[1][-1][0]
    first, second = ends[::-1] if swapped else ends
    left, right = first[-1][0], second[-1][0]
    if right - left < grid.link:  # one above the other
        right = left + grid.link
        second = [*second[:2], (second[-1][0], lane + LANE), (right, lane + LANE), (right, lane)]
    middle = 0.5 * (left + right)
    if isinstance(item, DrawnDeflection):
        label = text(middle, lane - 5.0, _reading(item.key, item.measures), kind)
        return path([*first, (right, lane)], kind) + path(second, kind) + label, right
    a, b = middle - 0.5 * grid.link + 5.0, middle + 0.5 * grid.link - 5.0
    lines = path([*first, (a, lane)]) + path([*second, (b, lane)])
    return lines + _elements(a, b, lane, item, not swapped), right
