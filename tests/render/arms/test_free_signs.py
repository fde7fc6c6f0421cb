"""Outputs that are negatives: computed as such where that costs nothing, and other values stay right."""

from __future__ import annotations

import random

import numpy as np
import pytest

from modelgen.render.arms.straight_line import KernelOutput, StraightLine, straight_line
from modelgen.symbolic.arms.expressions.evaluation import sampled
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol

JOINTS = ("1", "2", "3")
FUNCTIONS = {
    "add": np.add, "subtract": np.subtract, "multiply": np.multiply, "divide": np.divide, "cos": np.cos,
    "sin": np.sin, "negative": np.negative, "positive": np.positive,
}  # fmt: skip


def random_graph(seed: int) -> tuple[Graph, list[Ref]]:
    rng, graph = random.Random(seed), Graph()
    refs = [graph.symbol(Symbol("position", name, order)) for name in JOINTS for order in (0, 1)]
    refs += [graph.symbol(Symbol("cosine", name)) for name in JOINTS] + [
        graph.constant(3),
        graph.constant(-2),
    ]
    for _ in range(40):
        left, right = (rng.choice(refs) * rng.choice((-1, 1)) for _ in range(2))
        made = (graph.add if rng.random() < 0.5 else graph.multiply)(left, right)
        if made:
            refs.append(made)
    return graph, [rng.choice(refs) * rng.choice((-1, 1)) for _ in range(15)]


def run(line: StraightLine, values: dict[str, np.ndarray], outputs: int) -> np.ndarray:
    found, arrays = dict(values), np.full((outputs, 5), np.nan)
    for operation in line.operations:
        operands = [found[x] if isinstance(x, str) else x for x in operation.operands]
        found[operation.name] = np.broadcast_to(FUNCTIONS[operation.function](*operands), 5)
        if operation.target[0] == "o":
            arrays[int(operation.target[1:])] = found[operation.name]
    return arrays


@pytest.mark.parametrize("seed", range(40))
def test_outputs_are_what_the_graph_says(seed: int) -> None:
    graph, refs = random_graph(seed)
    names = {
        graph.symbol(Symbol("position", name, order)): f"q{order}{name}"
        for name in JOINTS
        for order in (0, 1)
    }
    line = straight_line(graph, [KernelOutput(ref, "all") for ref in refs], names, {}, {})
    rng = np.random.default_rng(seed)
    motion = {(name, order): rng.standard_normal(5) for name in JOINTS for order in (0, 1)}
    values = {f"q{order}{name}": array for (name, order), array in motion.items()}
    np.testing.assert_allclose(
        run(line, values, len(refs)).T, sampled(graph, refs, motion, {}), rtol=1e-12, atol=1e-12
    )


def test_a_difference_is_turned_round_and_what_is_named_keeps_its_sign() -> None:
    graph = Graph()
    a, b = (graph.symbol(Symbol("position", name)) for name in ("1", "2"))
    names = {a: "q1", b: "q2"}
    difference = abs(graph.subtract(graph.multiply(a, a), b))
    for kept, functions in (
        ({}, ["multiply", "subtract"]),
        ({difference: "w"}, ["multiply", "subtract", "negative"]),
    ):
        line = straight_line(graph, [KernelOutput(-difference, "all")], {**names, **kept}, {}, {})
        assert [operation.function for operation in line.operations] == functions
