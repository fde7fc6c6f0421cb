"""Values of nodes: in floating point over samples, and modulo a prime."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol
from modelgen.symbolic.arms.expressions.prime_field import PRIME, Residues, residue


def evaluate(
    graph: Graph, refs: Sequence[Ref], symbol: Callable[[Symbol], Any], constant: Callable[[Fraction], Any]
) -> list[Any]:
    """Return the values of references in any ring: what symbols and constants are in it is given.

    Values need +, * and unary minus; 1 / value only where the graph has reciprocals.
    """
    values: dict[int, Any] = {}

    def of(ref: Ref) -> Any:
        return values[ref] if ref >= 0 else -values[-ref]

    for index in graph.needed([0, *refs]):
        node = graph.nodes[index]
        if node.operation == "sum":
            values[index] = of(node.left) + of(node.right)
        elif node.operation == "product":
            values[index] = of(node.left) * of(node.right)
        elif node.operation == "reciprocal":
            values[index] = 1 / of(node.left)
        else:
            values[index] = constant(node.value) if node.symbol is None else symbol(node.symbol)
    return [of(ref) for ref in refs]


def sampled(
    graph: Graph,
    refs: Sequence[Ref],
    motion: Mapping[tuple[str, int], FloatArray],
    values: Mapping[str, float | FloatArray],
    speeds: Mapping[str, Ref] | None = None,
) -> FloatArray:
    """Return the values of references along a motion, shape (samples, references).

    Parameters
    ----------
    graph : Graph
        Where they are.
    refs : sequence of int
        The references.
    motion : mapping of (joint, order) to ndarray
        Coordinates [rad or m] and their derivatives by the time, each of shape (samples,); order 0, 1, 2.
    values : mapping of str to float or ndarray
        Lengths and parameters by name, in SI units; forces by the name of their joint with "force " in front
        (of measured torques "torque ", of payloads "load "; behind it the order of a derivative),
        also of shape (samples,).
    speeds : mapping of str to int, optional
        The speeds whose directions the references hold.
    """
    samples = len(next(iter(motion.values()), np.zeros(1)))

    def value(symbol: Symbol) -> Any:
        if symbol.kind == "position":
            return motion[symbol.name, symbol.order]
        if symbol.kind in ("cosine", "sine"):
            angle = motion[symbol.name, 0]
            return np.cos(angle) if symbol.kind == "cosine" else np.sin(angle)
        if symbol.kind == "direction":
            assert speeds is not None
            speed = evaluate(graph, [speeds[symbol.name]], value, float)[0]
            return _direction(speed, symbol)
        if symbol.kind in ("force", "torque", "load"):
            return values[f"{symbol.kind} {symbol.name}" + (f" {symbol.order}" if symbol.order else "")]
        return values[symbol.name]

    found = np.empty((samples, len(refs)))
    for place, column in enumerate(evaluate(graph, refs, value, float)):
        found[:, place] = column
    return found


def _direction(speed: FloatArray, symbol: Symbol) -> FloatArray:
    if symbol.of == "sign":
        return np.sign(speed)
    return np.asarray(speed > 0 if symbol.of == "forward" else speed < 0, dtype=float)


def residues(
    graph: Graph, refs: Sequence[Ref], samples: int, seed: int, lengths: Mapping[str, int]
) -> list[Residues]:
    """Return the values of references at random points modulo the prime, each of so many samples.

    Cosine and sine are those of a random half-angle's tangent t: (1 - t^2) / (1 + t^2), 2 t / (1 + t^2).
    Forward and backward are 1 and 0 or 0 and 1, and a sign their difference. Everything else is a random
    element of the field; `lengths` are the values of the named lengths, the same at all samples.
    """
    random = Random(seed)
    drawn: dict[tuple[str, str, int], Residues] = {}

    def draw(symbol: Symbol) -> Residues:
        key = (symbol.kind if symbol.kind not in ("cosine", "sine") else "angle", symbol.name, symbol.order)
        if key not in drawn:
            limit = 2 if symbol.kind == "direction" else PRIME
            drawn[key] = Residues([random.randrange(limit) for _ in range(samples)])
        return drawn[key]

    def value(symbol: Symbol) -> Residues:
        if symbol.kind == "length":
            return Residues([lengths[symbol.name]] * samples)
        x, one = draw(symbol), Residues([1] * samples)
        if symbol.kind in ("cosine", "sine"):
            share = 1 / (one + x * x)
            return (one + -(x * x)) * share if symbol.kind == "cosine" else (x + x) * share
        if symbol.kind == "direction" and symbol.of != "forward":
            return x + -(one + -x) if symbol.of == "sign" else one + -x
        return x

    return evaluate(graph, refs, value, lambda number: Residues([residue(number)] * samples))
