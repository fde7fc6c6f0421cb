"""Other estimators recover the truth where they can, and are compared with least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from generated import (
    emps300_qm_ac,
    emps300_qm_qc,
    emps_rigid_asymmetric_qm,
    emps_rigid_qm,
    three_mass_va_vb_vc,
)
from modelgen.errors import DataError
from modelgen.progress import heard
from modelgen.runtime.comparison.era_modes import modes_of_parameters, modes_of_record
from modelgen.runtime.comparison.kalman_filter import filter_parameters
from modelgen.runtime.comparison.other_estimators import measure
from modelgen.runtime.iv.output_error import Response, fit_response
from modelgen.runtime.model.mechanical_parts import CubicSpring
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.simulation.simulate import simulate

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
RIGID, ASYMMETRIC = model_from_module(emps_rigid_qm), model_from_module(emps_rigid_asymmetric_qm)
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


@pytest.mark.slow
@pytest.mark.parametrize("way", [filter_parameters, fit_response])
@pytest.mark.parametrize("model", [QC, AC])
def test_parameters_come_back_within_honest_intervals(model: Model, way: Callable[..., Response]) -> None:
    noise = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}
    noise = {key: level for key, level in noise.items() if key in model.channels}
    truth = model.parameter_sets["table_2"]
    record = simulate(model, truth, "chirp", duration_s=0.8, noise=noise, seed=3).record
    off = {name: value * (1.0 + 0.02 * (-1) ** i) for i, (name, value) in enumerate(truth.items())}
    found = way(model, [record], off)
    std = np.sqrt(np.diag(found.covariance))
    true = np.array([truth[name] for name in found.names])
    assert np.all(np.abs(found.values - true) < 3.5 * std)
    # precise, too: not by promising little
    by_name = dict(zip(found.names, std / true, strict=True))
    assert max(by_name[name] for name in ("J_m", "J_c", "K", "F_vmc")) < 0.004


@pytest.mark.slow
def test_a_kalman_filter_takes_innovations_as_they_are() -> None:
    # a friction that depends on the direction, where the model has one for both: a model that is wrong
    p = {"M": 95.0, "Fv_plus": 180.0, "Fc_plus": 20.0, "Fv_minus": 225.0, "Fc_minus": 20.0}
    assert set(p) == set(ASYMMETRIC.parameters)
    noise = {"q_m": 1e-7, "F": 0.1}
    record = simulate(ASYMMETRIC, p, "trapezoid", duration_s=6.0, fs=1000.0, noise=noise, seed=1).record
    found = filter_parameters(RIGID, [record], {"M": 95.0, "Fv": 200.0, "Fc": 20.0, "offset": 0.0})
    std = dict(zip(found.names, np.sqrt(np.diag(found.covariance)), strict=True))
    right = filter_parameters(ASYMMETRIC, [record], p)
    certain = dict(zip(right.names, np.sqrt(np.diag(right.covariance)), strict=True))
    assert std["Fv"] > 5.0 * certain["Fv_plus"]
    values = dict(zip(found.names, found.values, strict=True))
    assert abs(values["M"] - 95.0) < 4.0 * std["M"]


def test_a_kalman_filter_refuses_a_cubic_stiffness() -> None:
    hardening = replace(QC, cubic_springs=(CubicSpring("K", ((0, 1.0), (1, -1.0))),))
    with pytest.raises(DataError, match="Kalman filter: cannot handle a cubic stiffness; use another method"):
        filter_parameters(hardening, [], LIGHT)


def test_the_subspace_method_sees_the_elastic_mode() -> None:
    record = simulate(QC, LIGHT, "chirp", noise={"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}).record
    (true,) = modes_of_parameters(QC, LIGHT)
    assert true.frequency_hz == pytest.approx(123.6, abs=0.1)
    assert true.damping_ratio == pytest.approx(0.04, abs=0.001)
    found = modes_of_record(QC, record, 200.0)
    assert min(abs(mode.frequency_hz - true.frequency_hz) for mode in found) < 1.0


@pytest.mark.slow
def test_all_methods_side_by_side() -> None:
    records = [
        simulate(QC, LIGHT, kind, duration_s=0.8, fs=2500.0, noise=NOISE, seed=i).record
        for i, kind in enumerate(("chirp", "trapezoid"))
    ]
    said: list[str] = []
    with heard(said.append):
        found = measure(QC, records)
    names = ["wls", "iv", "output error", "Kalman filter"]
    assert [y.method for y in found.methods] == [word for word in said if word in names] == names
    assert said[-1] == "modes"
    for y in found.methods:
        assert not y.reason
        by_name = {name: (value, low, high) for name, value, low, high in y.parameters}
        value, low, high = by_name["K"]
        assert low < value < high
        assert value == pytest.approx(LIGHT["K"], rel=0.02)
    assert [source for source, _ in found.modes] == ["wls", "subspace, chirp", "subspace, trapezoid"]
