"""Which values of a kernel are computed with the other sign, so that an output needs no negative of them.

-(a - b) is b - a, and costs nothing; -(x + y) is (-x) - y where -x does; -(2 x) is (-2) x.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence

from modelgen.symbolic.arms.expressions.graph import Graph, Ref


def free_signs(
    graph: Graph,
    outputs: Sequence[Ref],
    read: Iterable[Ref],
    is_constant: Callable[[Ref], bool],
    kept: Collection[int],
) -> frozenset[int]:
    """Return the nodes whose negative is computed in their place.

    Parameters
    ----------
    graph, outputs
        What is computed.
    read : iterable of int
        What cosines, sines and directions are taken of: they are no operands in the graph.
    is_constant : callable
        Whether a reference is a number, whose sign is free.
    kept : collection of int
        Nodes that keep their sign, as what their names say.
    """
    uses = _uses(graph, [*outputs, *read], is_constant)

    def turned(index: int) -> list[int]:
        """Return the nodes to be negated for the negative of a node, or nothing where that has its price."""
        node = graph.nodes[index]
        if uses[index] != 1 or index in kept or node.operation not in ("sum", "product"):
            return []
        refs = (node.left, node.right)
        if any(map(is_constant, refs)) or (node.operation == "sum" and node.right < 0):
            return [index]
        below = next((found for ref in refs if (found := turned(abs(ref)))), [])
        return [*below, index] if below else []

    chosen: set[int] = set()
    for ref in outputs:
        if ref < 0 and not is_constant(ref):
            chosen.update(turned(-ref))
    return frozenset(chosen)


def _uses(graph: Graph, roots: Sequence[Ref], is_constant: Callable[[Ref], bool]) -> Counter[int]:
    """Return how often each node that is an array is an operand or one of the roots."""
    found = Counter(abs(ref) for ref in roots)
    for index in graph.needed(roots):
        node = graph.nodes[index]
        if not is_constant(index):
            found.update(abs(ref) for ref in (node.left, node.right) if ref and not is_constant(ref))
    return found
