"""Chains of which one parameter is given: a value that no step estimates is a value all the same."""

from __future__ import annotations

from functools import cache

import pytest

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import model_of

SERVO = """
chain = { name = "servo", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "l", inertia = "J_l" },
]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D" }]

[sensors.motor]
q_m = { body = "m", measures = "position" }
"""
TRUTH = {"J_m": 1e-3, "F_vm": 0.01, "F_sm": 0.03, "J_l": 2e-3, "K": 20.0, "D": 0.01}


@cache
def servo() -> tuple[Model, tuple[Record, ...]]:
    model = model_of(SERVO, "motor")
    options = {"fs": 1000.0, "duration_s": 2.0, "noise": {"q_m": 1e-5, "T": 1e-3}}
    made = [simulate(model, TRUTH, kind, seed=i, **options) for i, kind in enumerate(("chirp", "trapezoid"))]  # type: ignore[arg-type]
    return model, tuple(one.record for one in made)


@pytest.mark.slow
@pytest.mark.parametrize("given", TRUTH)
def test_the_others_are_found_beside_a_known_one(given: str) -> None:
    model, records = servo()
    estimate = identify(with_known(model, {given: TRUTH[given]}), records)
    found = {one.name: one for one in estimate.parameters.physical}
    assert found.keys() == TRUTH.keys() - {given}
    for name, one in found.items():
        assert abs(one.value - TRUTH[name]) < 3.0 * one.std, name
