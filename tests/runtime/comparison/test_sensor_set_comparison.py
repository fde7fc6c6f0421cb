"""Sensor sets side by side: noise gains, conditioning, and estimates that agree or do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.runtime.comparison.sensor_set_comparison import (
    conditioning,
    consistency,
    estimates_of,
    noise_gains,
)
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
LIGHT = QC.parameter_sets["light"]


def test_noise_gains_are_those_of_white_noise() -> None:
    noise = np.random.default_rng(0).standard_normal(400_000)
    smooth = zero_phase(noise, 6, 250.0, 5000.0)
    gains = {(g.channel, g.derivative): g.gain for g in noise_gains(AC, 6, 250.0, 5000.0)}
    for derivative in (2, 4):
        found = differentiate(smooth, 2e-4, derivative)[1000:-1000].std()
        assert gains["q_m", derivative] == pytest.approx(found, rel=0.02)
    assert ("q_c", 0) not in gains


def test_conditioning_of_the_simulated_pair() -> None:
    found = conditioning(QC, "table_2")
    assert 5.0 < found.condition_number < 100.0
    assert {g.derivative for g in found.gains} == {0, 1, 2}


def records() -> list[Record]:
    noise = {QC: {"q_m": 1e-7, "q_c": 1e-7}, AC: {"q_m": 1e-7, "a_c": 0.1}}
    found = []
    for kind in ("chirp", "trapezoid"):
        both = [simulate(model, LIGHT, kind, noise=levels).record for model, levels in noise.items()]
        found.append(replace(both[0], signals={**both[0].signals, **both[1].signals}))
    return found


def test_estimates_of_two_sensor_sets_agree_unless_a_sensor_is_wrong() -> None:
    good = records()
    # the default would find the wrong gain by itself
    qc, ac = estimates_of([QC, AC], good, "wls")
    (found,) = consistency({"qc": qc, "ac": ac})
    assert found.names == ("J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K")
    assert found.consistent
    assert found.p_value > 0.05
    # an accelerometer whose scale is wrong by a fifth
    wrong = [replace(r, signals={**r.signals, "a_c": 1.2 * r.signals["a_c"]}) for r in good]
    bad = estimates_of([AC], wrong, "wls")[0]
    (found,) = consistency({"qc": qc, "bad": bad})
    assert not found.consistent
    assert np.abs(found.deviations[found.names.index("J_c")]) > 3.0
