"""Rows that drop friction which reverses all the time: instruments in physical steps add it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from tests.runtime.iv.physical.swinging_servo import FS, SERVO, TRUTH, swung
from tests.runtime.iv.physical.test_composite_iv import model_of

RUBBING = {**TRUTH, "F_sl": 0.04}
FAST = [(4.3, 0.02, 0.0), (7.9, 0.02, 1.0), (11.0, 0.015, 2.0), (15.0, 0.01, 4.0), (21.0, 0.006, 5.0)]
SLOW = [(0.3, 1.0, 0.3), (0.7, 0.6, 1.0)]


@cache
def rubbing() -> Model:
    """Return the servo with friction at the load, which has an accelerometer."""
    text = SERVO.replace('inertia = "J_l"', 'inertia = "J_l", coulomb = "F_sl"')
    return model_of(text + 'a_l = { body = "l", measures = "acceleration" }\n', "motor")


@cache
def clean() -> tuple[Record, Record]:
    """Return 6 s that swing about rest, which alone show the spring, and 6 s of slow motion."""
    return swung(rubbing(), RUBBING, FAST, 6), swung(rubbing(), RUBBING, SLOW, 6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_spring_that_only_reversing_motion_shows_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    fast = clean()[0].signals
    noise = {"q_m": 2e-6, "a_l": 0.004 * np.std(fast["a_l"]), "T": 0.005 * np.std(fast["T"])}
    records = [
        Record(
            {key: one.signals[key] + level * rng.standard_normal(one.n) for key, level in noise.items()},
            FS,
            name,
        )
        for name, one in zip(("swing", "slow"), clean(), strict=True)
    ]
    found = {one.name: one for one in identify(rubbing(), records).parameters.physical}
    assert found.keys() == RUBBING.keys()
    for name, one in found.items():
        assert abs(one.value - RUBBING[name]) < 3.0 * one.std
    # without samples near reversals K was refused, or known to more than 100 %
    assert found["K"].std < 0.005 * RUBBING["K"]
