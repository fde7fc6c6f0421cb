"""Graphs of bodies and links as chains: every element has a name of its own."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

Edges = Sequence[tuple[int, int]]


def graph(edges: Edges, count: int, seen: Collection[int], damping: bool = True, ground: bool = False) -> str:
    """Return the TOML of a graph that is driven at its last body, with positions of the seen bodies."""
    lines = ["[chain]", 'name = "graph"', 'motion = "rotation"']
    for i in range(count):
        lines += ["[[bodies]]", f'name = "b{i}"', f'inertia = "J{i}"', f'viscous = "F{i}"']
    lines.append(f'actuator = "G{count - 1}"')
    links = [(f"b{i}", f"b{k}") for i, k in edges]
    links += [(f"b{i}", "ground") for i in range(count)] if ground else []
    for number, (first, second) in enumerate(links):
        lines += ["[[links]]", f'bodies = ["{first}", "{second}"]', f'stiffness = "K{number}"']
        lines += [f'damping = "D{number}"'] if damping else []
    lines.append("[sensors.set]")
    lines += [f'q{i} = {{ body = "b{i}", measures = "position" }}' for i in sorted(seen)]
    return "\n".join(lines)


def chain(count: int) -> Edges:
    return [(i, i + 1) for i in range(count - 1)]


def ring(count: int) -> Edges:
    return [*chain(count), (0, count - 1)]


def mesh(count: int) -> Edges:
    return list(combinations(range(count), 2))


def star(count: int) -> Edges:
    return [(0, i) for i in range(1, count)]


def wheel(count: int) -> Edges:
    return [*star(count), *chain(count)[1:], (1, count - 1)]


def bipartite(left: int, right: int) -> Edges:
    return [(i, left + k) for i in range(left) for k in range(right)]


def grid(rows: int, columns: int) -> Edges:
    across = [(i, i + 1) for i in range(rows * columns) if (i + 1) % columns]
    return [*across, *((i, i + columns) for i in range((rows - 1) * columns))]
