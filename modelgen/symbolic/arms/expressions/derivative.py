"""Derivatives of nodes by rules: d/dt along a motion, and by a coordinate or a speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from modelgen.symbolic.arms.expressions.graph import ONE, ZERO, Graph, Node, Ref, Symbol

# What a rule has made of a reference already.
Found = Callable[[Ref], Ref]


def time_derivatives(graph: Graph, refs: Sequence[Ref]) -> list[Ref]:
    """Return d/dt of every reference; directions are constant between reversals."""

    def rate(symbol: Symbol) -> Ref:
        if symbol.kind in ("position", "force", "torque", "reading"):
            return graph.symbol(symbol._replace(order=symbol.order + 1))
        if symbol.kind in ("cosine", "sine"):
            return graph.multiply(_turned(graph, symbol), graph.symbol(Symbol("position", symbol.name, 1)))
        return ZERO

    return derivatives(graph, refs, rate)


def partial_derivatives(graph: Graph, refs: Sequence[Ref], joint: str, order: int) -> list[Ref]:
    """Return the derivatives by a joint's coordinate (order 0), speed (1) or acceleration (2) alone."""

    def rate(symbol: Symbol) -> Ref:
        if symbol.name != joint:
            return ZERO
        if symbol.kind == "position":
            return ONE if symbol.order == order else ZERO
        if symbol.kind in ("cosine", "sine") and order == 0:
            return _turned(graph, symbol)
        return ZERO

    return derivatives(graph, refs, rate)


def derivatives(graph: Graph, refs: Sequence[Ref], rate: Callable[[Symbol], Ref]) -> list[Ref]:
    """Return the derivatives of references when every symbol changes at its rate."""

    def rule(index: Ref, node: Node, of: Found) -> Ref:
        if node.operation == "sum":
            return graph.add(of(node.left), of(node.right))
        if node.operation == "product":
            return graph.add(
                graph.multiply(of(node.left), node.right), graph.multiply(node.left, of(node.right))
            )
        if node.operation == "reciprocal":
            return -graph.multiply(of(node.left), graph.multiply(index, index))
        return ZERO if node.symbol is None else rate(node.symbol)

    return _rewritten(graph, refs, rule)


def substituted(graph: Graph, refs: Sequence[Ref], values: Mapping[Symbol, Ref]) -> list[Ref]:
    """Return references with symbols replaced."""

    def rule(index: Ref, node: Node, of: Found) -> Ref:
        if node.operation == "sum":
            return graph.add(of(node.left), of(node.right))
        if node.operation == "product":
            return graph.multiply(of(node.left), of(node.right))
        if node.operation == "reciprocal":
            return graph.reciprocal(of(node.left))
        return index if node.symbol is None else values.get(node.symbol, index)

    return _rewritten(graph, refs, rule)


def _rewritten(graph: Graph, refs: Sequence[Ref], rule: Callable[[Ref, Node, Found], Ref]) -> list[Ref]:
    """Return what a rule makes of references, node by node, from what it made of those that they need."""
    found: dict[Ref, Ref] = {ZERO: ZERO}

    def of(ref: Ref) -> Ref:
        return found[ref] if ref >= 0 else -found[-ref]

    for index in graph.needed(refs):
        found[index] = rule(index, graph.nodes[index], of)
    return [of(ref) for ref in refs]


def _turned(graph: Graph, symbol: Symbol) -> Ref:
    """Return the derivative of a sine or cosine by its angle."""
    if symbol.kind == "sine":
        return graph.symbol(symbol._replace(kind="cosine"))
    return -graph.symbol(symbol._replace(kind="sine"))
