from __future__ import annotations

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.diagnostics.friction_asymmetry import Asymmetry, asymmetry_notes
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate

RIGID = model_from_module(emps_rigid_qm)


def test_symmetric_friction_is_not_called_asymmetric() -> None:
    rng = np.random.default_rng(0)
    truth = RIGID.parameter_sets["published_2019"]
    record = simulate(RIGID, truth, "trapezoid", fs=1000.0, duration_s=10.0).record
    noisy = {"q_m": 1e-7, "F": 1.0}
    signals = {key: s + noisy[key] * rng.standard_normal(record.n) for key, s in record.signals.items()}
    estimate = identify(RIGID, Record(signals, 1000.0, "axis"), **values_of(drift_check=False))
    assert not any("direction of motion" in note for note in estimate.fit.notes)


def test_emps_prefers_asymmetric_friction(emps: Record) -> None:
    found = {
        method: identify(RIGID, emps, **values_of(method, drift_check=False)) for method in ("wls", "iv")
    }
    for estimate in found.values():
        assert "depends on the direction of motion" in estimate.summary().replace("\n    ", " ")
    wls, iv = found["wls"], found["iv"]
    for name in wls.params:
        spread = np.hypot(wls.bse[name], iv.bse[name])
        assert abs(wls.params[name] - iv.params[name]) < 1.96 * spread


def test_the_sentence_is_for_what_is_preferred_only() -> None:
    sure, unsure = Asymmetry("sign(d1_q_m)", -37.0, 2.0), Asymmetry("sign(d1_q_c)", 1.0, 0.5)
    (note,) = asymmetry_notes((sure, unsure), RIGID)
    assert "differ by -74" in note
    assert asymmetry_notes((unsure,), RIGID) == ()


def test_nothing_is_said_of_friction_without_a_number() -> None:
    (feature,) = (one.key for one in RIGID.features if one.function == "sign")
    sure = Asymmetry(feature, -37.0, 2.0)
    assert len(asymmetry_notes((sure,), RIGID)) == 1
    assert asymmetry_notes((sure,), RIGID, ("Fc",)) == ()


@pytest.mark.parametrize(("value", "preferred"), [(4.1, True), (-4.1, True), (3.9, False)])
def test_the_bound(value: float, preferred: bool) -> None:
    assert Asymmetry("sign(v)", value, 1.0).preferred is preferred
