from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.symbolic.arms.expressions.derivative import partial_derivatives, time_derivatives
from modelgen.symbolic.arms.expressions.evaluation import evaluate, residues, sampled
from modelgen.symbolic.arms.expressions.graph import ONE, ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.expressions.prime_field import residue

NAMES = ("a", "b", "c")


def random_expression(
    graph: Graph, rng: random.Random, depth: int, values: dict[str, Fraction]
) -> tuple[Ref, Fraction]:
    """Return a random node, and its value computed directly."""
    choice = rng.random()
    if depth == 0 or choice < 0.1:
        if rng.random() < 0.5:
            value = Fraction(rng.randint(-3, 3), rng.randint(1, 3))
            return graph.constant(value), value
        name = rng.choice(NAMES)
        return graph.symbol(Symbol("parameter", name)), values[name]
    left, x = random_expression(graph, rng, depth - 1, values)
    right, y = random_expression(graph, rng, depth - 1, values)
    if choice < 0.4:
        return graph.multiply(left, right), x * y
    if choice < 0.7:
        return graph.add(left, right), x + y
    if choice < 0.8:
        return graph.scale(Fraction(-2, 3), left), x * Fraction(-2, 3)
    if choice < 0.9 and x:
        return graph.reciprocal(left), 1 / x
    return graph.subtract(left, right), x - y


@given(st.integers(0, 10**9))
def test_values_are_those_of_the_operations(seed: int) -> None:
    rng = random.Random(seed)
    values = {name: Fraction(rng.randint(-9, 9) or 1, rng.randint(1, 9)) for name in NAMES}
    graph = Graph()
    ref, wanted = random_expression(graph, rng, 6, values)
    again, _ = random_expression(graph, random.Random(seed), 0, values)
    assert abs(again) < len(graph.nodes)
    assert evaluate(graph, [ref, -ref], lambda s: values[s.name], lambda x: x) == [wanted, -wanted]


@given(st.integers(0, 10**9))
def test_a_node_stands_once_and_operands_come_first(seed: int) -> None:
    graph, rng = Graph(), random.Random(seed)
    values = dict.fromkeys(NAMES, Fraction(2, 7))
    random_expression(graph, rng, 6, values)
    assert len(set(graph.nodes[2:])) == len(graph.nodes) - 2
    for index, node in enumerate(graph.nodes):
        assert max(abs(node.left), abs(node.right)) < max(index, 1)
        if node.operation in ("sum", "product"):
            assert node.left not in (0,) and node.right not in (0,)


def test_zeros_ones_and_signs_vanish() -> None:
    graph = Graph()
    a, b = (graph.symbol(Symbol("parameter", name)) for name in "ab")
    assert graph.add(a, ZERO) == a and graph.multiply(a, ONE) == a and graph.multiply(a, ZERO) == ZERO
    assert graph.add(a, -a) == ZERO
    assert graph.multiply(-a, b) == -graph.multiply(b, a)
    assert graph.subtract(a, b) == -graph.subtract(b, a)
    assert graph.add(a, graph.add(a, a)) == graph.scale(Fraction(3), a)
    half = graph.scale(Fraction(1, 2), graph.multiply(a, b))
    assert graph.multiply(graph.scale(Fraction(1, 2), b), a) == half
    assert graph.reciprocal(graph.constant(-4)) == graph.constant(Fraction(-1, 4))
    assert graph.reciprocal(ONE) == ONE
    with pytest.raises(ZeroDivisionError):
        graph.reciprocal(ZERO)


def moving(graph: Graph, rng: random.Random, depth: int) -> Ref:
    if depth == 0:
        name = rng.choice("xy")
        kind = rng.choice(["position", "cosine", "sine", "length"])
        order = rng.randint(0, 2) if kind == "position" else 0
        return graph.symbol(Symbol(kind, name, order))  # type: ignore[arg-type]
    left, right = moving(graph, rng, depth - 1), moving(graph, rng, depth - 1)
    choice = rng.random()
    if choice < 0.15:
        return graph.reciprocal(graph.add(graph.constant(7), graph.multiply(left, left)))
    return graph.multiply(left, right) if choice < 0.6 else graph.add(left, -right)


@pytest.mark.parametrize("seed", range(20))
def test_derivatives_are_those_of_a_complex_step(seed: int) -> None:
    graph, rng = Graph(), random.Random(seed)
    ref = moving(graph, rng, 4)
    at = {(name, order): rng.uniform(-1, 1) for name in "xy" for order in range(4)}

    def value(symbol: Symbol, step: dict[tuple[str, int], complex]) -> complex:
        if symbol.kind == "length":
            return 0.3
        x = at[symbol.name, symbol.order] + step.get((symbol.name, symbol.order), 0)
        return complex({"position": x, "cosine": np.cos(x), "sine": np.sin(x)}[symbol.kind])

    def slope(step: dict[tuple[str, int], complex]) -> float:
        small = {key: 1e-30j * rate for key, rate in step.items()}
        return float(evaluate(graph, [ref], lambda s: value(s, small), float)[0].imag) / 1e-30

    found = [*time_derivatives(graph, [ref]), *partial_derivatives(graph, [ref], "x", 0)]
    found += partial_derivatives(graph, [ref], "y", 1)
    wanted = [slope({key: at[key[0], key[1] + 1] for key in at if key[1] < 3})]
    wanted += [slope({("x", 0): 1}), slope({("y", 1): 1})]
    values = evaluate(graph, found, lambda s: value(s, {}), float)
    np.testing.assert_allclose(np.real(values), wanted, rtol=1e-9, atol=1e-12)


def test_a_force_has_a_rate_of_its_own_and_directions_are_constant() -> None:
    graph = Graph()
    force = graph.symbol(Symbol("force", "x"))
    assert time_derivatives(graph, [force]) == [graph.symbol(Symbol("force", "x", 1))]
    assert time_derivatives(graph, [graph.symbol(Symbol("direction", "x", of="sign"))]) == [ZERO]


def test_samples_and_residues_of_the_same_graph() -> None:
    graph = Graph()
    cosine, sine = (graph.symbol(Symbol(kind, "x")) for kind in ("cosine", "sine"))  # type: ignore[arg-type]
    one = graph.add(graph.multiply(cosine, cosine), graph.multiply(sine, sine))
    size = graph.symbol(Symbol("length", "d"))
    directions = [graph.symbol(Symbol("direction", "x", of=of)) for of in ("sign", "forward", "backward")]
    refs = [one, graph.scale(Fraction(1, 3), size), *directions]
    field = residues(graph, refs, 50, 1, {"d": residue(Fraction(3, 7))})
    assert set(field[0].values) == {1} and set(field[1].values) == {residue(Fraction(1, 7))}
    for sign, forward, backward in zip(*(f.values for f in field[2:]), strict=True):
        assert (sign, forward, backward) in ((1, 1, 0), (residue(-1), 0, 1))
    speed = graph.symbol(Symbol("position", "x", 1))
    motion = {("x", 0): np.linspace(0, 1, 3), ("x", 1): np.array([-2.0, 0.0, 1.0])}
    wanted = [[1, 0.1, -1, 0, 1], [1, 0.1, 0, 0, 0], [1, 0.1, 1, 1, 0]]
    found = sampled(graph, refs, motion, {"d": 0.3}, {"x": speed})
    np.testing.assert_allclose(found, wanted, rtol=1e-15)
