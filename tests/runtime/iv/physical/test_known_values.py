"""Chains of which one parameter is given: a value that no step estimates is a value all the same."""

from __future__ import annotations

from functools import cache

import pytest

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.swinging_servo import servo

TRUTH = {"J_m": 1e-3, "F_vm": 0.01, "F_sm": 0.03, "J_l": 2e-3, "K": 20.0, "D": 0.01}


@cache
def records() -> tuple[Record, ...]:
    options = {"fs": 1000.0, "duration_s": 2.0, "noise": {"q_m": 1e-5, "T": 1e-3}}
    kinds = enumerate(("chirp", "trapezoid"))
    return tuple(simulate(servo(), TRUTH, kind, seed=i, **options).record for i, kind in kinds)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("given", TRUTH)
def test_the_others_are_found_beside_a_known_one(given: str) -> None:
    estimate = identify(with_known(servo(), {given: TRUTH[given]}), records())
    found = {one.name: one for one in estimate.parameters.physical}
    assert found.keys() == TRUTH.keys() - {given}
    for name, one in found.items():
        assert abs(one.value - TRUTH[name]) < 3.0 * one.std, name
