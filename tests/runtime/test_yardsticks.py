"""Other estimators recover the truth where they can, and stand beside least squares."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, three_mass_va_vb_vc
from modelgen.errors import DataError
from modelgen.runtime.contract import model_from_module
from modelgen.runtime.kalman import filter_parameters
from modelgen.runtime.output_error import fit_response
from modelgen.runtime.simulate import simulate
from modelgen.runtime.subspace import modes_of_parameters, modes_of_record
from modelgen.runtime.yardsticks import measure

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
LIGHT = QC.parameter_sets["light"]
NOISE = {"q_m": 2e-6, "q_c": 2e-6, "Gamma_m": 1e-5}


def test_output_error_finds_its_way_back() -> None:
    record = simulate(AC, LIGHT, "chirp", duration_s=0.8, noise={"q_m": 1e-7, "a_c": 0.1}).record
    off = {name: value * (1.0 + 0.03 * (-1) ** i) for i, (name, value) in enumerate(LIGHT.items())}
    found = fit_response(AC, [record], off)
    assert found.names == AC.parameters
    for name, value in zip(found.names, found.values, strict=True):
        assert value == pytest.approx(LIGHT[name], rel=5e-3)
    assert np.all(np.diag(found.covariance) > 0.0)


def test_output_error_needs_a_position_to_follow() -> None:
    model = model_from_module(three_mass_va_vb_vc)
    p = model.parameter_sets["nominal"]
    record = simulate(model, p, "chirp", duration_s=0.5).record
    with pytest.raises(DataError, match="output error: body a has no position sensor to follow"):
        fit_response(model, [record], p)


def test_a_kalman_filter_comes_closer_to_the_truth() -> None:
    noise = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
    record = simulate(QC, LIGHT, "chirp", duration_s=0.6, noise=noise, seed=1).record
    off = {**LIGHT, "K": 1.03 * LIGHT["K"], "J_c": 0.97 * LIGHT["J_c"]}
    found = filter_parameters(QC, [record], off)
    values = dict(zip(found.names, found.values, strict=True))
    for name in ("K", "J_c", "J_m"):
        assert values[name] == pytest.approx(LIGHT[name], rel=0.015)


def test_the_subspace_method_sees_the_elastic_mode() -> None:
    record = simulate(QC, LIGHT, "chirp", noise={"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}).record
    (true,) = modes_of_parameters(QC, LIGHT)
    assert true.frequency_hz == pytest.approx(123.6, abs=0.1)
    assert true.damping_ratio == pytest.approx(0.04, abs=0.001)
    found = modes_of_record(QC, record, 200.0)
    assert min(abs(mode.frequency_hz - true.frequency_hz) for mode in found) < 1.0


def test_all_methods_side_by_side() -> None:
    records = [
        simulate(QC, LIGHT, kind, duration_s=0.8, fs=2500.0, noise=NOISE, seed=i).record
        for i, kind in enumerate(("chirp", "trapezoid"))
    ]
    said: list[str] = []
    found = measure(QC, records, said.append)
    assert [y.method for y in found.methods] == [*said[:-3], "output error", "Kalman filter"]
    assert said[-1] == "modes"
    for y in found.methods[:-1]:
        assert not y.reason
        by_name = {name: (value, low, high) for name, value, low, high in y.parameters}
        value, low, high = by_name["K"]
        assert low < value < high
        assert value == pytest.approx(LIGHT["K"], rel=0.02)
    assert [source for source, _ in found.modes] == ["wls", "subspace, chirp", "subspace, trapezoid"]
