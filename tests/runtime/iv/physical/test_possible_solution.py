from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.iv.physical.gauss_newton_step import GaussNewtonStep, possible_solution
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock

NAMES = ("J", "F_sm", "F_sl", "K")
TRUTH = np.array([1.0, 0.03, 0.02, 5.0])
ROLES = dict(zip(NAMES, ("inertia", "coulomb", "coulomb", "stiffness"), strict=True))
MODEL: Any = SimpleNamespace(
    parameters=NAMES, roles={name: SimpleNamespace(role=role) for name, role in ROLES.items()}
)


def step(apart: float, seed: int) -> GaussNewtonStep:
    """Return a step whose columns of friction differ by a share, which is not what the rows have there."""
    rng = np.random.default_rng(seed)
    n = 4000
    W = rng.standard_normal((n, 4))
    W[:, 1] = np.sign(W[:, 1])
    Y = W[:, [0, 1, 1, 3]] @ TRUTH + 2e-3 * rng.standard_normal(n)
    W[:, 2] = W[:, 1] + apart * W[:, 2]
    block = RowBlock(0, 0, "run", "m", "N m", np.arange(n), n, Y, W, 0, True, 8.0, 0)
    fit = fit_matched(Observation(NAMES, (block,)))
    return GaussNewtonStep(fit, (), np.eye(4), fit, fit, ())


@pytest.mark.parametrize("seed", range(4))
def test_friction_of_bodies_that_turn_together_stays_possible(seed: int) -> None:
    one = step(5e-5, seed)
    assert min(one.x[1:3]) < -0.1 < max(one.x[1:3])  # many times the friction, from the one to the other
    now = np.array([0.9, 0.02, 0.02, 4.0])
    x = possible_solution(one, MODEL, now)
    # their difference stays, and all else is known
    assert x[1] - x[2] == pytest.approx(0.0, abs=1e-3)
    assert x[1] + x[2] == pytest.approx(0.05, abs=2e-4)
    assert x[[0, 3]] == pytest.approx(TRUTH[[0, 3]], abs=2e-4)


def test_friction_that_the_rows_know_goes_where_they_say() -> None:
    one = step(0.5, 0)
    for now in (np.array([0.9, 0.02, 0.02, 4.0]), np.array([0.9, 1e-5, 3.0, 4.0])):
        np.testing.assert_array_equal(possible_solution(one, MODEL, now), one.x)
    # a body that has none may have less than none by chance
    bare = np.array([0.9, 0.0, 0.0, 4.0])
    np.testing.assert_array_equal(possible_solution(step(5e-5, 0), MODEL, bare), step(5e-5, 0).x)
