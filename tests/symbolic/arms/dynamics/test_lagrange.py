from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import pytest

from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.dynamics.inverse_dynamics import inverse_dynamics
from modelgen.symbolic.arms.dynamics.lagrange import (
    lagrange_torques,
    newton_minus_lagrange,
    vanishes,
)
from modelgen.symbolic.arms.expressions.evaluation import evaluate
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol
from tests.symbolic.arms.made_arms import PANDA, PLANAR, PUMA, STANFORD, random_arm, serial, tx40

SMALL = [PLANAR[2], serial(STANFORD[:3], True), serial(PUMA[:3], True),
         serial([(0, 0, 0, 0), (90, "d2", 0, 0), (0, "d3", 0, "r3")], True, lengths={"d2": None, "d3": None,
                                                                                    "r3": None})]  # fmt: skip
SMALL += [random_arm(random.Random(seed), joints=2) for seed in range(6)]
LARGE = [tx40(), serial(PANDA, True), *(random_arm(random.Random(seed)) for seed in range(20, 30))]


def normal_forms(graph: Graph, refs: Sequence[Ref]) -> list[Any]:
    """Return references as polynomials in all symbols, in which no sine has a power above one: 0 is zero.

    For small arms: the polynomials of six joints have millions of terms. No reciprocal may stand in them.
    """
    from sympy import QQ, ring

    symbols = [
        node.symbol for node in (graph.nodes[k] for k in graph.needed(refs)) if node.symbol is not None
    ]
    if not symbols:
        return list(refs)
    names = [f"x{place}" for place in range(len(symbols))]  # no name of a spec reaches SymPy
    made = ring(names, QQ)
    whole, generators = made[0], dict(zip(symbols, made[1:], strict=True))
    circles = []
    for symbol in symbols:
        if symbol.kind == "sine":
            cosine = generators.get(symbol._replace(kind="cosine"))
            if cosine is not None:
                circles.append(generators[symbol] ** 2 + cosine**2 - 1)

    def constant(value: Fraction) -> Any:
        return whole(QQ(value.numerator, value.denominator))

    found = evaluate(graph, refs, lambda symbol: generators[symbol], constant)
    return [polynomial.rem(circles) if circles else polynomial for polynomial in found]


@pytest.mark.parametrize("spec", SMALL)
def test_newton_euler_is_lagrange_in_full(spec: ArmSpec) -> None:
    graph, differences = newton_minus_lagrange(spec)
    assert not any(normal_forms(graph, differences))


@pytest.mark.parametrize("spec", [*SMALL, *LARGE])
def test_newton_euler_is_lagrange_at_points_of_a_field(spec: ArmSpec) -> None:
    graph, differences = newton_minus_lagrange(spec)
    assert vanishes(graph, differences, list(spec.lengths))


@pytest.mark.parametrize("seed", range(6))
def test_a_difference_would_be_found(seed: int) -> None:
    # each of many nodes wrong in turn: a factor in one term of one joint
    spec, graph, rng = serial(PUMA[:2], True), Graph(), random.Random(seed)
    torques = inverse_dynamics(graph, spec)
    lagrange = lagrange_torques(graph, spec)
    name = rng.choice(["Izz2", "mx2", "Ia1", "fv2", "fs1", "off2"])
    extra = graph.scale(Fraction(1, 10**9), graph.symbol(Symbol("parameter", name)))
    joint = rng.choice(["1", "2"])
    wrong = graph.add(graph.subtract(torques[joint], lagrange[joint]), extra)
    assert not vanishes(graph, [wrong], [])
    assert any(normal_forms(graph, [wrong]))


def test_normal_forms_know_that_sine_and_cosine_lie_on_a_circle() -> None:
    graph = Graph()
    cosine, sine = graph.symbol(Symbol("cosine", "x")), graph.symbol(Symbol("sine", "x"))
    ones = graph.total([graph.multiply(cosine, cosine), graph.multiply(sine, sine), -1])
    assert normal_forms(graph, [ones]) == [0] and vanishes(graph, [ones], [])
    assert normal_forms(graph, [graph.constant(Fraction(2, 3))]) and not normal_forms(graph, [0])[0]
