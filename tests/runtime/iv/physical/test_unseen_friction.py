"""Friction of a body that no sensor sees, and of one whose rows drop it: the direction is simulated."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.physical.starting_values import with_shared_friction
from modelgen.runtime.records.record import Record
from tests.runtime.iv.physical.swinging_servo import FS, swung
from tests.runtime.rows.test_dropped_friction import three

TRUTH = {
    "J_m": 4e-3,
    "F_vm": 8e-3,
    "F_sm": 0.1,
    "J_c": 6e-3,
    "F_vc": 4e-3,
    "F_sc": 0.03,
    "J_l": 5e-3,
    "F_vl": 2e-3,
    "F_sl": 0.02,
    "D_1": 0.03,
    "K_1": 120.0,
    "D_2": 0.02,
    "K_2": 60.0,
}
PLACES = [(0.7, 0.6, 0.0), (1.9, 0.3, 1.0), (4.3, 0.1, 2.0), (12.0, 0.03, 4.0), (24.0, 0.01, 5.0)]


def swinging() -> Record:
    clean = swung(three(), TRUTH, PLACES, 4)
    rng = np.random.default_rng(5)
    step = 2.0 * np.pi / 2**18
    signals = {key: clean.signals[key] for key in ("q_m", "q_l", "T")}
    for key in ("q_m", "q_l"):
        signals[key] = step * np.round(signals[key] / step)
    signals["T"] = signals["T"] + 0.005 * np.std(signals["T"]) * rng.standard_normal(clean.n)
    return Record(signals, FS, "swing")


def test_friction_that_comes_out_of_both_signs_is_shared_to_begin_with() -> None:
    # bodies that move as one tell the sum only
    bent = {**TRUTH, "F_sm": 780.0, "F_sc": -779.9, "F_sl": 0.05}
    shared = with_shared_friction(three(), bent)
    assert [shared[name] for name in ("F_sm", "F_sc", "F_sl")] == pytest.approx([0.05] * 3)
    assert all(shared[name] == bent[name] for name in TRUTH if not name.startswith("F_s"))
    assert with_shared_friction(three(), TRUTH) == TRUTH


@pytest.mark.slow
def test_friction_of_a_body_that_no_sensor_sees_is_estimated_by_default() -> None:
    found = identify(three(), swinging())
    assert any("method iv, in the physical parameters" in note for note in found.fit.notes)
    known = {entry.name: entry for entry in found.parameters.physical}
    for name, percent in {"J_m": 1.0, "J_c": 1.0, "J_l": 1.0, "K_1": 1.0, "K_2": 1.0, "F_sc": 30.0}.items():
        assert known[name].relative_std < percent
    for name, entry in known.items():
        assert abs(entry.value - TRUTH[name]) < 3.0 * entry.std


def test_least_squares_say_what_the_friction_of_that_body_needs() -> None:
    record = swinging()
    with pytest.raises(DataError, match="c has Coulomb friction in the spec") as refused:
        identify(three(), record, method="wls")
    assert "leave that friction out of the spec" in str(refused.value)
