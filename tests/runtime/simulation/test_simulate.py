"""The closed loop as a whole: against an ODE solver, the equations of motion, and the model's own rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from generated import (
    emps300_qm_ac,
    emps300_qm_qc,
    emps_rigid_asymmetric_qm,
    three_mass_va_vb_vc,
    tree_mixed,
    two_mass_bench_qm_qc,
)
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, default_controller
from modelgen.runtime.simulation.excitation import Excitation, chirp, trapezoid
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
LIGHT = QC.parameter_sets["light"]
BENCH = model_from_module(two_mass_bench_qm_qc)


def bench_values() -> dict[str, float]:
    role = {
        "inertia": 5e-3,
        "viscous": 0.02,
        "coulomb": 0.2,
        "offset": 0.05,
        "damping": 0.02,
        "stiffness": 550.0,
    }
    return {name: role[BENCH.roles[name].role] * (1.0 + 0.1 * i) for i, name in enumerate(BENCH.parameters)}


def test_smooth_motion_agrees_with_an_ode_solver() -> None:
    p = {**LIGHT, "F_sm": 0.0}
    fs, loop = 2000.0, PositionVelocityController(kp=0.3, kv=2e-3)
    nodes = np.arange(101) / fs
    wave = Excitation(
        30.0 * nodes, np.full(101, 30.0), 0.05 * np.sin(2.0 * np.pi * 90.0 * nodes), rate_hz=fs, name="mine"
    )
    found = simulate(AC, p, wave, fs=fs, controller=loop)

    def motion(t: float, x: np.ndarray) -> list[float]:
        qm, qc, vm, vc = x
        torque = 0.3 * (30.0 * t - qm) + 2e-3 * (30.0 - vm) + float(np.interp(t, nodes, wave.feedforward))
        link = p["K"] * (qm - qc) + p["F_vmc"] * (vm - vc)
        return [vm, vc, (torque - p["F_vm"] * vm - link) / p["J_m"], link / p["J_c"]]

    x = np.zeros(4)
    for k in range(100):
        x = solve_ivp(
            motion, (nodes[k], nodes[k + 1]), x, method="DOP853", rtol=1e-12, atol=1e-13
        ).y[:, -1]  # fmt: skip
        ours = [found.true[key][k + 1] for key in ("q_m", "q_c", "v_m", "v_c")]
        np.testing.assert_allclose(ours, x, rtol=1e-9, atol=1e-10)
    assert found.true["a_c"][100] == pytest.approx(motion(nodes[100], x)[3], rel=1e-8)


@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
@pytest.mark.parametrize("values", ["table_1", "table_2", "light"])
def test_the_equations_of_motion_hold_at_every_sample(kind: str, values: str) -> None:
    p = AC.parameter_sets[values]
    x = simulate(AC, p, kind).true
    link = p["F_vmc"] * (x["v_m"] - x["v_c"]) + p["K"] * (x["q_m"] - x["q_c"])
    np.testing.assert_allclose(
        x["Gamma_m"], p["J_m"] * x["a_m"] + p["F_vm"] * x["v_m"] + x["friction_m"] + link, atol=1e-12
    )
    np.testing.assert_allclose(0.0, p["J_c"] * x["a_c"] - link, atol=1e-12)
    slips = x["mode_m"] != 0.0
    np.testing.assert_array_equal(x["friction_m"][slips], p["F_sm"] * x["mode_m"][slips])
    assert np.all(np.abs(x["friction_m"]) <= p["F_sm"])
    assert np.all(x["v_m"][~slips] == 0.0)
    assert np.all(x["a_m"][~slips] == 0.0)


def test_the_models_own_sum_row_holds_at_every_sample() -> None:
    p = AC.parameter_sets["table_2"]
    found = simulate(AC, p, "trapezoid").true
    # derivatives that the sum row does not use are left at 0
    signals: dict[str, Any] = {signal.key: np.zeros(found["q_m"].size) for signal in AC.signals}
    signals |= {"q_m": found["q_m"], "d1_q_m": found["v_m"], "d2_q_m": found["a_m"], "a_c": found["a_c"]}
    signals |= {"Gamma_m": found["Gamma_m"]}
    row = next(i for i, row in enumerate(AC.rows) if row.differentiated == 0)
    left = AC.measurement(signals)[:, row]
    right = AC.regressor(signals)[:, row] @ AC.base_from_physical(p)
    slips = found["mode_m"] != 0.0  # sign() of a body at rest is no friction force
    assert slips.sum() > 5000
    np.testing.assert_allclose(left[slips], right[slips], atol=1e-9)


def test_two_bodies_with_friction_and_offsets() -> None:
    p = bench_values()
    found = simulate(BENCH, p, "trapezoid", duration_s=3.0)
    x = found.true
    assert {change.body for change in found.changes} == {"m", "c"}
    for body, names in {"m": ("Fsm", "Om"), "c": ("Fsc", "Oc")}.items():
        coulomb, offset = (p[name] for name in names)
        held = x[f"friction_{body}"] - offset
        slips = x[f"mode_{body}"] != 0.0
        np.testing.assert_allclose(held[slips], coulomb * np.sign(x[f"v_{body}"][slips]), rtol=1e-12)
        assert np.all(np.abs(held) <= coulomb * (1.0 + 1e-12))
    total = sum(p[f"J{b}"] * x[f"a_{b}"] + p[f"Fv{b}"] * x[f"v_{b}"] + x[f"friction_{b}"] for b in ("m", "c"))
    np.testing.assert_allclose(x["i"], total, atol=1e-11)


def test_friction_that_depends_on_direction() -> None:
    model = model_from_module(emps_rigid_asymmetric_qm)
    p = dict(zip(model.parameters, (95.0, 200.0, 20.0, 260.0, 26.0), strict=True))
    assert [model.roles[name].role for name in p] == ["inertia", "viscous", "coulomb", "viscous", "coulomb"]
    x = simulate(model, p, "trapezoid", duration_s=6.0).true
    forward, backward = x["v_m"] > 0.0, x["v_m"] < 0.0
    mass, fv_plus, fs_plus, fv_minus, fs_minus = p.values()
    for side, fv, fs in ((forward, fv_plus, fs_plus), (backward, fv_minus, -fs_minus)):
        assert side.sum() > 1000
        expected = mass * x["a_m"][side] + fv * x["v_m"][side] + fs
        np.testing.assert_allclose(x["F"][side], expected, atol=1e-9)
    held = x["F"][x["mode_m"] == 0.0]
    assert held.size > 100
    assert np.all((held <= fs_plus) & (held >= -fs_minus))


def test_sensors_read_what_they_measure() -> None:
    model = model_from_module(tree_mixed)
    found = simulate(model, model.parameter_sets["nominal"], "chirp")
    x, record = found.true, found.record.signals
    assert list(record)[:6] == ["q_m", "v_g", "a_a", "q_gb", "Gamma_m", "Gamma_b"]
    np.testing.assert_allclose(record["q_gb"], x["q_g"] - x["q_b"], atol=1e-15)
    np.testing.assert_array_equal(record["v_g"], x["v_g"])
    assert np.all(record["Gamma_b"] == 0.0)
    # the accelerometer sees the true friction, also while its body sticks
    p = found.settings.parameters
    sticks = x["mode_a"] == 0.0
    assert 0 < sticks.sum() < sticks.size
    assert np.all(np.abs(record["a_a"][sticks]) < 1e-9)
    link = p["K_ga"] * (x["q_g"] - x["q_a"]) + p["F_dga"] * (x["v_g"] - x["v_a"])
    np.testing.assert_allclose(p["J_a"] * record["a_a"], link - x["friction_a"], atol=1e-9)


def test_the_record_brings_the_directions_that_the_model_asks_for() -> None:
    model = model_from_module(tree_mixed)
    directions = [s.key for s in model.signals if s.sensor is None and s.actuator is None]
    found = simulate(model, model.parameter_sets["nominal"], "trapezoid", noise={"v_g": 1e-3})
    assert set(model.channels) <= set(found.record.signals)
    for key in directions:
        velocity = found.true[key.replace("sign_", "v_")]
        np.testing.assert_array_equal(found.record.signals[key], np.sign(velocity))


def test_a_pull_below_breakaway_moves_nothing() -> None:
    nodes = np.arange(4001)
    pull = np.interp(nodes, [0, 2000, 4000], [0.0, 0.9999 * LIGHT["F_sm"], 0.0])
    wave = Excitation(0.0 * nodes, 0.0 * nodes, pull, 40000.0)
    found = simulate(QC, LIGHT, wave)
    assert found.changes == ()
    assert np.all(found.true["q_m"] == 0.0)
    np.testing.assert_allclose(found.true["friction_m"], found.true["Gamma_m"], atol=1e-18)
    wave = Excitation(0.0 * nodes, 0.0 * nodes, 1.25 * pull / 0.9999, 40000.0)
    change = simulate(QC, LIGHT, wave).changes[0]
    assert (change.body, change.mode) == ("m", 1)
    assert change.time_s == pytest.approx(0.8 * 2000 / 40000.0, abs=1e-15)


def test_internal_steps_do_not_matter() -> None:
    wave = chirp(20.0, 200.0, 1.0, 5000.0, force=0.05, velocity=20.0, oversample=2)
    coarse = simulate(QC, LIGHT, wave)
    fine_nodes = np.arange((wave.t.size - 1) * 5 + 1) / 5.0
    r, rate, force = (
        np.interp(fine_nodes, np.arange(wave.t.size), array)
        for array in (wave.reference, wave.reference_rate, wave.feedforward)
    )
    fine = simulate(QC, LIGHT, Excitation(r, rate, force, 50000.0))
    assert (coarse.settings.oversample, fine.settings.oversample) == (2, 10)
    for key in ("q_m", "q_c", "v_c", "a_c", "Gamma_m"):
        scale = np.abs(coarse.true[key]).max()
        np.testing.assert_allclose(fine.true[key], coarse.true[key], atol=1e-9 * scale)


def test_ten_seconds_stay_on_the_reference() -> None:
    found = simulate(QC, LIGHT, "chirp", duration_s=10.0, fs=2000.0)
    error = found.true["q_m"] - found.reference.reference[:: found.settings.oversample]
    assert found.true["q_m"][-1] > 500.0
    # at rest again, but for what dry friction holds
    assert abs(error[-1]) < 2.0 * LIGHT["F_sm"] / found.settings.controller.kp


def test_a_free_swing_from_an_initial_state() -> None:
    model = model_from_module(three_mass_va_vb_vc)
    p = model.parameter_sets["nominal"]
    nothing = Excitation(np.zeros(20001), np.zeros(20001), np.zeros(20001), 10000.0)
    start = [0.0, 0.1, -0.1, 5.0, 0.0, -3.0]
    found = simulate(
        model, p, nothing, fs=5000.0, controller=PositionVelocityController(0.0, 0.0), initial_state=start
    )
    x = found.true
    assert [x[key][0] for key in ("q_a", "q_b", "q_c", "v_a", "v_b", "v_c")] == start
    energy = 0.5 * sum(p[f"J_{b}"] * x[f"v_{b}"] ** 2 for b in "abc")
    energy += 0.5 * p["K_ab"] * (x["q_a"] - x["q_b"]) ** 2 + 0.5 * p["K_bc"] * (x["q_b"] - x["q_c"]) ** 2
    assert np.all(np.diff(energy) <= 1e-13)
    assert energy[-1] < 0.1 * energy[0]


def test_a_seed_repeats_a_record_and_changes_only_the_noise() -> None:
    noise = {"q_m": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}
    first, again, other = (simulate(AC, LIGHT, "chirp", noise=noise, seed=seed) for seed in (1, 1, 2))
    assert first.record == again.record
    assert first.record != other.record
    for key in first.true:
        np.testing.assert_array_equal(first.true[key], other.true[key])
    for key, level in noise.items():
        assert (first.record.signals[key] - first.true[key]).std() == pytest.approx(level, rel=0.05)


def test_quantised_readings_do_not_disturb_the_motion() -> None:
    step = 2.0 * np.pi / 4000.0
    rough = simulate(QC, LIGHT, "trapezoid", resolution={"q_m": step})
    np.testing.assert_array_equal(rough.true["q_m"], simulate(QC, LIGHT, "trapezoid").true["q_m"])
    error = rough.record.signals["q_m"] - rough.true["q_m"]
    assert np.abs(error).max() == pytest.approx(step / 2.0, rel=0.05)
    np.testing.assert_array_equal(rough.record.signals["q_c"], rough.true["q_c"])


def test_the_settings_say_how_it_was_made() -> None:
    found = simulate(AC, LIGHT, "trapezoid", noise={"a_c": 1.0}, seed=7, fs=4000.0, duration_s=1.0)
    plant = make_plant(AC, LIGHT)
    assert dict(found.settings.parameters) == dict(LIGHT)
    assert found.settings.controller == default_controller(plant)
    assert (found.settings.actuator, found.settings.fs, found.settings.oversample) == ("Gamma_m", 4000.0, 32)
    assert (dict(found.settings.noise), dict(found.settings.resolution)) == ({"a_c": 1.0}, {})
    assert found.settings.seed == 7
    assert (found.record.name, found.record.tag) == ("trapezoid", "trapezoid")
    assert (found.record.n, found.record.fs) == (4000, 4000.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"excitation": "sine"}, "excitation: there is no kind 'sine'"),
        (
            {"excitation": [0.0, 1.0]},
            "excitation: is of the type list; give a modelgen.runtime.",
        ),
        (
            {"controller": {"kp": 1.0}},
            "controller: is of the type dict; give a modelgen.runtime.",
        ),
        ({"drive": 1000.0}, "drive: is of the type float; give a modelgen.runtime.simulation.drive.Drive"),
        ({"noise": {"q_x": 1.0}}, "noise: has no channel q_x"),
        ({"resolution": {"q_m": -1.0}}, "resolution: q_m: is -1.0; give zero or a positive number"),
        ({"actuator": "Gamma_c"}, "actuator: there is no 'Gamma_c'; choose one of Gamma_m"),
        ({"seed": -1}, "seed: is -1; give a whole number, 0 or more"),
        ({"fs": 0.0}, "fs: "),
        ({"initial_state": [0.0, 1.0]}, "initial_state: has shape (2,)"),
        ({"controller": PositionVelocityController(-1.0, -1.0)}, "simulation: grows without bound"),
        (
            {"excitation": trapezoid([1.0], 9.0, 1.0, 1000.0), "fs": 3000.0},
            "excitation trapezoid: has 32000 Hz, no whole multiple of fs = 3000 Hz; make both fit",
        ),
        (
            {"excitation": trapezoid([1.0], 9.0, 1.0, 1000.0), "fs": 1000.0, "duration_s": 1.0},
            "duration_s: is given, but the Excitation has its own; leave it out",
        ),
    ],
)
def test_wrong_options_are_explained(options: dict[str, Any], message: str) -> None:
    with pytest.raises(DataError) as caught:
        simulate(QC, LIGHT, **options)
    assert str(caught.value).startswith(message)


def test_missing_parameters_are_named() -> None:
    with pytest.raises(DataError, match="parameters: K: is missing; give its value in N m/rad"):
        simulate(QC, {name: value for name, value in LIGHT.items() if name != "K"})
