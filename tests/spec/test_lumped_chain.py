"""Two bodies as one: the equations of the chain with both coordinates the same."""

from __future__ import annotations

import random
from collections.abc import Mapping

import pytest

from modelgen.spec.load import parse_spec
from modelgen.spec.lumped_chain import lumped
from modelgen.symbolic.equations.newton import Equation, motion_equations
from tests.symbolic.random_chains import random_spec

# signal -> what multiplies it; sums over the parameters
Balance = dict[tuple[str, str, int], float]


def balance(
    equations: tuple[Equation, ...], values: Mapping[str, float], alias: Mapping[str, str]
) -> Balance:
    found: Balance = {}
    for equation in equations:
        for term in equation.terms:
            signal = term.signal
            place = (signal.kind, alias.get(signal.name, signal.name), signal.order)
            size = 1.0 if term.parameter is None else values[term.parameter]
            sign = -1.0 if term.parameter is None else 1.0
            found[place] = found.get(place, 0.0) + sign * size * float(term.coefficient)
    return {place: value for place, value in found.items() if abs(value) > 1e-12}


@pytest.mark.parametrize("seed", range(60))
def test_the_equations_are_those_of_the_chain_with_one_coordinate_for_both(seed: int) -> None:
    rng = random.Random(seed)
    spec = parse_spec(random_spec(rng), "chain.toml")
    values = {parameter.name: rng.uniform(0.5, 2.0) for parameter in spec.parameters}
    equations = motion_equations(spec).equations
    for index, link in enumerate(spec.links):
        found = lumped(spec, index, values)
        if found is None:
            continue
        one, sums = found
        kept, gone = link.bodies
        assert set(sums) == {parameter.name for parameter in one.parameters}
        assert gone not in [body.name for body in one.bodies]
        assert len(one.links) == len(spec.links) - 1
        for equation in motion_equations(one).equations:
            own = tuple(
                e for e in equations if e.body == equation.body or (equation.body == kept and e.body == gone)
            )
            expected = balance(own, values, {gone: kept})
            assert balance((equation,), sums, {}) == pytest.approx(expected)


def test_most_links_without_a_gear_can_be_rigid() -> None:
    tried = made = 0
    for seed in range(40):
        rng = random.Random(seed)
        spec = parse_spec(random_spec(rng), "chain.toml")
        values = {parameter.name: 1.0 for parameter in spec.parameters}
        for index, link in enumerate(spec.links):
            if link.ratio == 1 and "ground" not in link.bodies:
                tried += 1
                made += lumped(spec, index, values) is not None
    assert made > 0.5 * tried
