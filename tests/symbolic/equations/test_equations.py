"""Newton-Euler and Lagrange agree, and two bodies give the paper's equations."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import catalog_names, catalog_path, load_spec, parse_spec
from modelgen.symbolic.equations.lagrange import lagrange_equations, newton_minus_lagrange
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.equations.signals import Signal, Term


@pytest.mark.parametrize("name", catalog_names())
def test_newton_equals_lagrange_for_the_catalogue(name: str) -> None:
    motion = motion_equations(load_spec(catalog_path(name)))
    assert newton_minus_lagrange(motion) == (0,) * len(motion.equations)


@pytest.mark.parametrize("seed", range(12))
def test_newton_equals_lagrange_for_random_trees_and_loops(seed: int) -> None:
    spec = random_chain(seed)
    assert newton_minus_lagrange(motion_equations(spec)) == (0,) * len(spec.bodies)


def test_the_proof_notices_a_wrong_equation() -> None:
    motion = motion_equations(load_spec(catalog_path("emps300")))
    wrong = motion.equations[0].terms[:-1]
    broken = type(motion)(motion.spec, (type(motion.equations[0])("m", wrong), motion.equations[1]))
    assert newton_minus_lagrange(broken)[0] != 0


def test_lagrange_does_not_use_newton() -> None:
    assert set(lagrange_equations(load_spec(catalog_path("emps300")))) == {"m", "c"}


def test_two_bodies_give_equations_1_and_2_of_the_paper() -> None:
    first, second = motion_equations(load_spec(catalog_path("emps300"))).equations

    def term(parameter: str | None, kind: str, name: str, order: int, sign: int = 1) -> Term:
        return Term(parameter, Signal(kind, name, order), Fraction(sign))  # type: ignore[arg-type]

    assert first.terms == (
        term(None, "force", "Gamma_m", 0),
        term("J_m", "coordinate", "m", 2),
        term("F_vm", "coordinate", "m", 1),
        term("F_sm", "sign", "m", 0),
        term("F_vmc", "coordinate", "m", 1),
        term("F_vmc", "coordinate", "c", 1, -1),
        term("K", "coordinate", "m", 0),
        term("K", "coordinate", "c", 0, -1),
    )
    assert second.terms == (
        term("J_c", "coordinate", "c", 2),
        term("F_vmc", "coordinate", "m", 1, -1),
        term("F_vmc", "coordinate", "c", 1),
        term("K", "coordinate", "m", 0, -1),
        term("K", "coordinate", "c", 0),
    )


def random_chain(seed: int) -> ChainSpec:
    """Return a random connected chain with every kind of element; loops where two bodies meet again."""
    rng = random.Random(seed)
    count = rng.randint(1, 5)
    lines = ["[chain]", f'name = "random_{seed}"', 'title = "random"', 'motion = "rotation"']
    for i in range(count):
        lines += ["[[bodies]]", f'name = "b{i}"', f'inertia = "J{i}"']
        lines += [f'{kind} = "{kind}{i}"' for kind in ("viscous", "coulomb", "offset") if rng.random() < 0.6]
        if rng.random() < 0.3:
            lines.append('friction = "asymmetric"')
        if i == 0 or rng.random() < 0.3:
            lines.append(f'actuator = "Gamma{i}"')
    pairs = [(rng.randrange(i), i) for i in range(1, count)]
    pairs += [(0, count - 1)] if count > 2 else []
    ends = [(f"b{i}", f"b{k}") for i, k in pairs] + (
        [(f"b{count - 1}", "ground")] if rng.random() < 0.5 else []
    )
    for n, (i, k) in enumerate(ends):
        lines += ["[[links]]", f'bodies = ["{i}", "{k}"]', f'stiffness = "K{n}"']
        lines += [f'damping = "D{n}"'] if rng.random() < 0.7 else []
        lines += [f'stiffness3 = "C{n}"'] if rng.random() < 0.3 else []
        lines += [f"ratio = {rng.choice(['2.0', '0.5', '-3.0', '1.25'])}"] if rng.random() < 0.5 else []
    lines += ["[sensors.all]"] + [f'q{i} = {{ body = "b{i}", measures = "position" }}' for i in range(count)]
    return parse_spec("\n".join(lines), f"random_{seed}.toml")
