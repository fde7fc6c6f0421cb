from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from modelgen.runtime.parameters.robust_starts import robust_starts
from modelgen.spec.load import parse_spec

# The drum between motor and trolley has no sensor: 17 composites of 11 parameters.
TROLLEY = """
chain = { name = "trolley", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "d", inertia = "J_d" },
    { name = "t", motion = "translation", inertia = "M_t", viscous = "F_vt", coulomb = "F_st" },
]
links = [
    { bodies = ["m", "d"], stiffness = "K_1", damping = "D_1", ratio = 8 },
    { bodies = ["d", "t"], stiffness = "K_2", damping = "D_2", lead = 0.25 },
]
sensors.ends.q_m = { body = "m", measures = "position" }
sensors.ends.x_t = { body = "t", measures = "position" }
"""
TRUTH = {
    "J_m": 3e-3, "F_vm": 4e-3, "F_sm": 0.3, "J_d": 0.06, "M_t": 180.0, "F_vt": 60.0, "F_st": 90.0,
    "K_1": 900.0, "D_1": 1.2, "K_2": 1.2e6, "D_2": 900.0,
}  # fmt: skip


@cache
def model() -> Model:
    return model_from_text(generate(parse_spec(TROLLEY, "trolley.toml"), "ends"))


@pytest.mark.parametrize("seed", range(2))
def test_one_composite_that_noise_has_bent_does_not_lead_the_fit_astray(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = model().base_from_physical(TRUTH)
    bent = model().base_parameters.index("D_1*D_2/(K_1 + 0.00158314*K_2)")
    std = 2e-3 * np.abs(true)
    base = true + std * rng.standard_normal(len(true))
    base[bent] *= 21.0
    std[bent] = base[bent]
    C = np.diag(std**2)
    found = physical_parameters(model(), base, Covariances(C, C, 0.0 * C, C), {}, {})
    assert {one.name for one in found.parameters} == set(TRUTH)
    for one in found.parameters:
        assert abs(one.value - TRUTH[one.name]) < 5.0 * one.std, one.name
        assert one.value == pytest.approx(TRUTH[one.name], rel=0.2)


def test_without_errors_the_search_ends_at_the_truth() -> None:
    true = model().base_from_physical(TRUTH)
    found = robust_starts(model(), true, np.zeros_like(true))
    assert any(start == pytest.approx(TRUTH, rel=1e-3) for start in found)
