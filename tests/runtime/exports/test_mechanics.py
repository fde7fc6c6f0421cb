"""A module's direct model taken apart gives the same accelerations and readings when put together again."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

import numpy as np
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, three_mass_qa_qb_ac, tree_mixed
from modelgen.array_types import FloatArray
from modelgen.errors import ModelError
from modelgen.runtime.exports.mechanics import Mechanics, mechanics
from modelgen.runtime.model.model import Model, model_from_module
from tests.runtime.exports.open_loop import GEARED, model_of
from tests.symbolic.random_chains import random_spec

SHARED = """
chain = { name = "shared", motion = "rotation" }
bodies = [
    { name = "a", inertia = "J", viscous = "B", actuator = "T" },
    { name = "b", inertia = "J", viscous = "B" },
    { name = "c", inertia = "J_c" },
]
links = [
    { bodies = ["a", "b"], stiffness = "K", damping = "D", RATIO },
    { bodies = ["b", "c"], stiffness = "K", damping = "D_2" },
    { bodies = ["c", "ground"], stiffness = "K", stiffness3 = "K3" },
    { bodies = ["a", "c"], stiffness = "K_2" },
]
[sensors.all]
q_a = { body = "a", measures = "position" }
q_b = { body = "b", measures = "position" }
q_c = { body = "c", measures = "position" }
a_b = { body = "b", measures = "acceleration" }
"""
UNEVEN = """
chain = { name = "uneven", motion = "translation" }
bodies = [
    { name = "a", inertia = "M", viscous = "B_plus", coulomb = "F_minus", friction = "asymmetric" },
    { name = "b", inertia = "M_b", viscous = "B_minus", coulomb = "F", friction = "asymmetric", DRIVEN },
]
links = [{ bodies = ["a", "b"], stiffness = "K" }]
[sensors.all]
v_a = { body = "a", measures = "velocity" }
q_b = { body = "b", measures = "position" }
"""
MODELS = {
    "uneven": model_of(UNEVEN.replace("DRIVEN", 'actuator = "T"')),
    "emps300": model_from_module(emps300_qm_ac),
    "asymmetric": model_from_module(emps_rigid_asymmetric_qm),
    "three masses": model_from_module(three_mass_qa_qb_ac),
    "tree": model_from_module(tree_mixed),
    "geared": model_of(GEARED),
    "shared": model_of(SHARED.replace(", RATIO", "")),
    "shared and geared": model_of(SHARED.replace("RATIO", "ratio = -3.5")),
    "screw": model_of(SHARED.replace("RATIO", 'ratio = "2*pi/0.01"')),
}


def accelerations(
    chain: Mechanics, values: Mapping[str, float], state: FloatArray, force: FloatArray, ways: FloatArray
) -> FloatArray:
    """Return the accelerations of the bodies without Coulomb friction and cubic springs."""
    n = len(chain.bodies)
    total = np.zeros(n)
    for push, size in zip(chain.pushes, force, strict=True):
        total[push.body] += size
    for i, body in enumerate(chain.bodies):
        name = body.viscous[0 if ways[i] > 0 else 1]
        total[i] -= (values[name] if name else 0.0) * state[n + i]
        if body.friction is not None and body.friction.offset:
            total[i] -= values[body.friction.offset]
    for spring in chain.springs:
        lever = np.zeros(n)
        for place, factor in spring.lever:
            lever[place] = factor
        pull = values[spring.stiffness] * (lever @ state[:n]) if spring.stiffness else 0.0
        pull += values[spring.damping] * (lever @ state[n:]) if spring.damping else 0.0
        total -= lever * pull
    return total / np.array([values[body.inertia] for body in chain.bodies])


@pytest.mark.parametrize("name", MODELS)
def test_the_parts_move_as_the_whole(name: str) -> None:
    check_parts(MODELS[name])


@pytest.mark.parametrize("seed", range(16))
def test_the_parts_of_random_chains_move_as_the_whole(seed: int) -> None:
    try:
        model = model_of(random_spec(Random(seed)), "set")
    except ModelError:  # no rows for these sensors: nothing to identify, nothing to export
        return
    check_parts(model)


def check_parts(model: Model) -> None:
    """Compare accelerations and readings of the mechanism with those of the direct model."""
    chain = mechanics(model)
    n = len(chain.bodies)
    rng = np.random.default_rng(3)
    for _ in range(4):
        values = {key: float(rng.uniform(0.5, 2.0)) for key in (*model.parameters, *model.known)}
        state, force = rng.standard_normal(2 * n), rng.standard_normal(len(chain.pushes))
        ways = rng.choice([-1.0, 1.0], n)
        space = model.state_space(values, {b.name: int(w) for b, w in zip(chain.bodies, ways, strict=True)})
        offsets = [values[f.offset] if f.offset else 0.0 for f in model.friction]
        expected = space.A @ state + space.B @ force + space.E @ offsets
        found = accelerations(chain, values, state, force, ways)
        np.testing.assert_allclose(found, expected[n:], rtol=1e-11, atol=1e-11)
        readings = space.C @ state + space.D @ force + space.F @ offsets
        sources = (state[:n], state[n:], found)
        for reading, size in zip(chain.readings, readings, strict=True):
            total = sum(factor * sources[reading.order][place] for place, factor in reading.lever)
            assert total == pytest.approx(size, rel=1e-9, abs=1e-10)


def test_a_lever_is_the_deflection_of_the_spec() -> None:
    chain = mechanics(MODELS["geared"])
    assert [body.motion for body in chain.bodies] == ["rotation", "translation"]
    link = next(spring for spring in chain.springs if spring.stiffness == "K")
    assert link.damping == "D"
    assert link.lever == ((0, pytest.approx(0.02 / 2 / np.pi, rel=1e-15)), (1, -1.0))
    assert [s.lever for s in mechanics(MODELS["shared"]).springs if s.stiffness3] == [((2, 1.0),)]


def test_cubic_springs_join_the_linear_ones_of_their_lever() -> None:
    springs: Model = MODELS["shared"]
    found = [s for s in mechanics(springs).springs if s.stiffness3 == "K3"]
    assert len(found) == 1 and found[0].stiffness == "K"
