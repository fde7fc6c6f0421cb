"""Whatever chain a user describes: its module passes the check without trust, and is a model when loaded."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest

from modelgen.errors import ModelError
from modelgen.generated_module.module_check import module_problems
from modelgen.render.writer import generate
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.load import parse_spec
from tests.fuzz.test_specs import NIGHTLY
from tests.symbolic.random_chains import random_spec

RATIOS = ("1e-9", "-3.7e5", "0.3333333333333333", "12345.678")
VALUES = ("0.5", "1e-20", "3e8", "2")


def any_chain(seed: int) -> str:
    """Return the TOML of a random chain with springs, friction and gears of every kind, some of it known."""
    rng = random.Random(seed)
    cubic = rng.random() < 0.4
    lines, names = [], []
    for line in random_spec(rng, most_bodies=5).splitlines():
        key, _, value = line.partition(" = ")
        lines.append(f"ratio = {rng.choice(RATIOS)}" if key == "ratio" and rng.random() < 0.5 else line)
        if key in ("inertia", "stiffness", "damping", "offset"):
            names.append(value.strip('"'))
        if key == "coulomb" and rng.random() < 0.4:
            lines.append('friction = "asymmetric"')
        elif key == "coulomb":
            names.append(value.strip('"'))
        elif key == "stiffness" and cubic and rng.random() < 0.5:
            lines.append(f'stiffness3 = {value[:-1]}_3"')
    if cubic:  # it needs its deflection undifferentiated
        bodies = dict.fromkeys(re.findall(r'name = "(b\d+)"', "\n".join(lines)))
        lines += [f'p_{body} = {{ body = "{body}", measures = "position" }}' for body in bodies]
    known = [f"{name} = {rng.choice(VALUES)}" for name in names if rng.random() < 0.15]
    return "\n".join([*lines, "[known]", *known])


@pytest.mark.parametrize("seed", range(600 if NIGHTLY else 30))
def test_the_module_of_any_chain_is_accepted(seed: int) -> None:
    try:
        text = generate(parse_spec(any_chain(seed), "chain.toml"), "set")
    except ModelError:
        return  # with a reason that other tests read: too many unseen bodies, nothing left to estimate
    assert module_problems(text) == []
    model_from_text(text)


@pytest.mark.slow
def test_most_random_chains_have_a_module() -> None:
    made = 0
    for seed in range(12):
        try:
            made += bool(generate(parse_spec(any_chain(seed), "chain.toml"), "set"))
        except ModelError:
            continue
    assert made >= 5


def test_a_long_chain_is_accepted() -> None:
    bodies = "".join(
        f'[[bodies]]\nname = "b{i}"\ninertia = "J{i}"\nviscous = "v{i}"\ncoulomb = "c{i}"\noffset = "o{i}"\n'
        f'actuator = "T{i}"\nfriction = "{"asymmetric" if i < 10 else "symmetric"}"\n'
        for i in range(20)
    )
    links = "".join(
        f'[[links]]\nbodies = ["b{i}", "b{i + 1}"]\nstiffness = "K{i}"\ndamping = "D{i}"\nratio = 1.5\n'
        for i in range(19)
    )
    sensors = "".join(f'q{i} = {{ body = "b{i}", measures = "velocity" }}\n' for i in range(20))
    head = f'[chain]\nname = "long"\ntitle = "{"Größe " * 33}"\nmotion = "rotation"\n'
    text = generate(parse_spec(f"{head}{bodies}{links}[sensors.all]\n{sensors}", "long.toml"), "all")
    assert module_problems(text) == []


def test_friction_of_known_size_stands_on_the_left_hand_side() -> None:
    text = """
    chain = { name = "axis", motion = "rotation" }
    bodies = [{ name = "m", inertia = "J", coulomb = "F_s", actuator = "T" }]
    known = { F_s = 0.5 }
    [sensors.all]
    q_m = { body = "m", measures = "position" }
    """
    model = model_from_text(generate(parse_spec(text, "axis.toml"), "all"))
    velocity = np.array([-2.0, 0.0, 3.0])
    signals = {"T": np.ones(3), "d1_q_m": velocity, "d2_q_m": np.zeros(3)}
    assert model.measurement(signals)[:, 0] == pytest.approx(1.0 - 0.5 * np.sign(velocity))
