"""Parameter-free sums: add the equations of connected bodies and the links inside cancel.

The sum stays linear in the physical parameters and often needs fewer differentiations than its parts: what
forces a row to be differentiated is a link whose deflection the sensors do not give. Contracting those links
leaves groups of bodies; the sums of the groups are the low-order rows. One pass per level of
differentiation, so the cost grows linearly with the chain. The row (1) + (2) of Pham 2002, (14), is one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from modelgen.spec.chain import GROUND, ChainSpec, Link
from modelgen.symbolic.equations.signals import Exact, Term, collect, quotient

NEVER = 99  # level of a link whose deflection the sensors never give


@dataclass(frozen=True)
class Group:
    """Connected bodies with the weights that make the links inside them cancel."""

    weights: tuple[tuple[str, Exact], ...]

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies in the order of the spec."""
        return tuple(body for body, _ in self.weights)


def sum_terms(terms_of: Mapping[str, Sequence[Term]], group: Group) -> tuple[Term, ...]:
    """Return the weighted sum of the group's equations; the terms of its inner links have cancelled."""
    return collect(
        term._replace(coefficient=term.coefficient * weight)
        for body, weight in group.weights
        for term in terms_of[body]
    )


def groups(spec: ChainSpec, level_of_link: Sequence[int | None]) -> Iterator[tuple[int, Group]]:
    """Yield (level, group): bodies tied by links that need more than `level` differentiations."""
    levels = [NEVER if level is None else level for level in level_of_link]
    for level in range(min(max(levels, default=0), 2)):
        tied = [
            link
            for link, needed in zip(spec.links, levels, strict=True)
            if needed > level and "ground" not in link.bodies
        ]
        yield from ((level, group) for group in _components(spec, tied))


def levers(spec: ChainSpec) -> dict[str, float]:
    """Return how far each body moves when the chain moves as a rigid one, the first body by 1.

    A force on a body counts, at the first body, as force times lever: that makes forces and rows on both
    sides of a gear comparable. Around a loop of contradictory ratios the shortest way counts.
    """
    return {body: float(weight) for body, weight in exact_levers(spec).items()}


def exact_levers(spec: ChainSpec) -> dict[str, Exact]:
    """Return the levers as the rational numbers that they are."""
    weights, _ = _weights(spec.bodies[0].name, _neighbours(spec.links))
    return {body: weight if weight > 0 else -weight for body, weight in weights.items()}


def contradicts_itself(spec: ChainSpec) -> bool:
    """Return whether the gear ratios around a loop do not multiply to 1."""
    neighbours = _neighbours(spec.links)
    seen: set[str] = set()
    for body in neighbours:
        if body not in seen:
            weights, consistent = _weights(body, neighbours)
            seen.update(weights)
            if not consistent:
                return True
    return False


def _neighbours(links: Sequence[Link]) -> dict[str, list[tuple[str, Exact]]]:
    neighbours: dict[str, list[tuple[str, Exact]]] = {}
    for link in links:
        first, second = link.bodies
        if GROUND in link.bodies:
            continue
        # w_first / N = w_second makes the link's two forces cancel in the sum.
        neighbours.setdefault(first, []).append((second, quotient(1, link.ratio)))
        neighbours.setdefault(second, []).append((first, quotient(link.ratio, 1)))
    return neighbours


def _components(spec: ChainSpec, links: Sequence[Link]) -> Iterator[Group]:
    """Yield the connected groups of two bodies or more, as far as gear ratios around loops are consistent."""
    neighbours = _neighbours(links)
    seen: set[str] = set()
    for body in spec.bodies:
        if body.name in seen or body.name not in neighbours:
            continue
        weights, consistent = _weights(body.name, neighbours)
        seen.update(weights)
        if consistent:
            yield Group(tuple((b.name, weights[b.name]) for b in spec.bodies if b.name in weights))


def _weights(start: str, neighbours: Mapping[str, list[tuple[str, Exact]]]) -> tuple[dict[str, Exact], bool]:
    weights: dict[str, Exact] = {start: 1}
    consistent, queue = True, deque([start])
    while queue:
        body = queue.popleft()
        for other, factor in neighbours.get(body, ()):
            weight = weights[body] * factor
            if other not in weights:
                weights[other] = weight
                queue.append(other)
            elif weights[other] != weight:
                consistent = False
    return weights, consistent
