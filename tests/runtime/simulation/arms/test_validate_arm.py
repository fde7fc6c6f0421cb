"""Arms validated: closed loops along references, and forces that a measured motion needs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import modelgen
from modelgen.errors import DataError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.comparison.arm_forces import compare_forces
from modelgen.runtime.fleet.worker import FleetRecord, identify_machine
from modelgen.runtime.iv.companion_simulation import Loop
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.simulate_arm import record_with_joint_references, simulate_arm
from modelgen.runtime.simulation.arms.validate_arm import validate_arm
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.runtime.made_arm_records import catalogued, model_of, written

MODEL = model_of(catalogued("two_link"))
VALUES = MODEL.parameter_sets["nominal"]
LOOP = JointController(bandwidth_hz=6.0)
NOISE = {"q_1": 2e-5, "q_2": 2e-5, "tau_1": 0.2, "tau_2": 0.05}


@cache
def record(seed: int = 0) -> Record:
    found = simulate_arm(MODEL, VALUES, noise=NOISE, seed=seed, controller=LOOP, fs=500.0)
    return replace(record_with_joint_references(found), name=f"run_{seed}")


@cache
def estimate(method: str) -> Estimate:
    if method == "loop":
        return modelgen.identify(MODEL, record(), modelgen.IV(loop=Loop(LOOP)))
    return modelgen.identify(MODEL, record(), method)


def deviations(found: Estimate) -> np.ndarray:
    truth = dict(zip(MODEL.base_parameters, MODEL.base_from_physical(VALUES).tolist(), strict=True))
    return np.array([(value - truth[name]) / found.bse[name] for name, value in found.params.items()])


def test_forces_are_those_that_the_motion_needs() -> None:
    """With the truth nothing but noise is left; with a heavier link, a force that the link needs."""
    (right,) = compare_forces(MODEL, VALUES, [record()])
    assert {check.channel for check in right.checks} == {"tau_1", "tau_2"} and right.held_out
    assert min(check.fit for check in right.checks) > 98.0
    (wrong,) = compare_forces(MODEL, {**VALUES, "mx_2": 1.2 * VALUES["mx_2"]}, [record()], used=["run_0"])
    assert not wrong.held_out
    assert max(check.rms_error for check in wrong.checks) > 3.0 * max(c.rms_error for c in right.checks)


@pytest.mark.slow
def test_the_closed_loop_of_the_record_is_found_again() -> None:
    (found,) = validate_arm(MODEL, estimate("iv").params, [record()], LOOP)
    assert found.kind == "closed loop" and not found.notes
    for sensor in ("q_1", "q_2"):
        assert found.check(sensor, "position").fit > 99.9
        assert found.check(sensor, "tracking error").fit > 90.0
    assert found.check("tau_1", "force").rms_error < 1.2 * NOISE["tau_1"]


def test_what_has_no_number_counts_as_zero_and_is_named() -> None:
    base = dict(zip(MODEL.base_parameters, MODEL.base_from_physical(VALUES).tolist(), strict=True))
    del base["off_2"]
    (found,) = compare_forces(MODEL, base, [record()])
    assert found.notes == ("taken as zero: off_2",)
    with pytest.raises(DataError, match="none of the model"):
        compare_forces(MODEL, {"J": 1.0}, [record()])


@pytest.mark.parametrize("key", ["reference_2", "tau_1", "q_2"])
def test_a_channel_that_is_missing_is_told(key: str) -> None:
    given = record()
    poor = Record({k: v for k, v in given.signals.items() if k != key}, given.fs, "poor")
    with pytest.raises(DataError, match=key):
        validate_arm(MODEL, VALUES, [poor], LOOP)


@pytest.mark.parametrize("method", ["iv", "loop", "auto"])
def test_instruments_find_an_arm_and_the_delays_of_its_drives(method: str) -> None:
    """From the closed loop, and from the slow part of the motion where no controller is known."""
    found = estimate(method)
    assert found.fit.method == "iv"
    assert len(found.params) == len(MODEL.base_parameters)
    assert np.sqrt(np.mean(deviations(found) ** 2)) < 2.0
    late, std = found.fit.delays, found.fit.delay_std
    assert set(late) == {"tau_1", "tau_2"}
    assert all(abs(late[key]) < 4.0 * std[key] for key in late)


def test_drives_that_report_late_are_set_right() -> None:
    given, samples = record(), 3
    late = {key: np.roll(line, samples) for key, line in given.signals.items() if key.startswith("tau")}
    found = modelgen.identify(MODEL, replace(given, signals={**given.signals, **late}, name="late"))
    std = found.fit.delay_std
    for key, delay in found.fit.delays.items():
        assert abs(delay - samples / given.fs) < 4.0 * std[key] and std[key] < 1.0 / given.fs
    assert np.sqrt(np.mean(deviations(found) ** 2)) < 2.0


def test_a_record_with_more_than_noise_is_left_to_least_squares() -> None:
    given = record()
    t = np.arange(given.n) / given.fs
    torque = given.signals["tau_2"] + 0.5 * np.sin(3.0 * np.pi * t)
    found = modelgen.identify(
        MODEL, replace(given, signals={**given.signals, "tau_2": torque}, name="pushed")
    )
    assert found.fit.method == "wls" and "more than noise" in found.fit.notes[0]


@pytest.mark.parametrize(
    ("method", "what"),
    [
        (modelgen.TLS(), "use iv or wls"),
        (modelgen.IV(start="nominal"), "leave it out"),
        (modelgen.IV(loop=Loop(PositionVelocityController(1.0, 1.0))), "JointController"),
    ],
)
def test_methods_that_an_arm_has_not_are_told(method: modelgen.WLS, what: str) -> None:
    with pytest.raises(modelgen.ModelgenError, match=what):
        modelgen.identify(MODEL, record(), method)


def test_a_record_that_was_held_out_agrees() -> None:
    checks = modelgen.CheckOptions(hold_out=["run_1"])
    found = modelgen.identify(MODEL, [record(), record(1)], checks=checks)
    assert found.fit.method == "iv" and found.checks.held_out is not None
    assert found.checks.held_out.records == ("run_1",)
    assert all(row.relative_error < 1.3 * row.fitted_error for row in found.checks.held_out.rows)


def test_a_machine_of_a_fleet_is_identified_as_alone() -> None:
    text = arm_module(arm_base_model(arm_rows(catalogued("two_link"))))
    report = identify_machine(text, [FleetRecord("robot", record())], {})
    assert report.document is not None and not report.failed
    alone = estimate("auto").params
    assert report.document["params"] == pytest.approx(alone, rel=1e-9)


PAYLOAD = """
[arm]
name = "one"
gravity = [0, -9.81, 0]
drive = ["rotor_inertia", "viscous", "coulomb"]
[[joints]]
name = "1"
[payload.tool]
mass = 2.0
"""


def test_what_an_arm_carries_counts_in_every_simulation_of_it() -> None:
    model = model_of(written(PAYLOAD))
    values = {**dict.fromkeys(model.parameters, 0.1), "Izz_1": 0.5, "mx_1": 1.0, "m_tool": 2.0}
    values["mx_tool"] = 0.8
    options = {"controller": LOOP, "fs": 500.0, "duration_s": 4.0}
    made = simulate_arm(model, values, payloads=["tool"], **options)
    full = replace(record_with_joint_references(made), name="full")
    assert np.all(full.signals["load_tool"] == 1.0)
    # the rows of the module hold for what was simulated
    fast = np.abs(made.true["d1_q_1"]) > 1e-3
    signals = {**made.true, "load_tool": np.ones(full.n)}
    torque = model.regressor(signals)[:, 0] @ model.base_from_physical(values)
    left = model.measurement(signals)[:, 0] - torque
    assert np.abs(left[fast]).max() < 1e-6 * np.ptp(made.true["tau_1"])
    forgotten = Record({key: line for key, line in full.signals.items() if key != "load_tool"}, full.fs)
    for one, fits in ((full, True), (forgotten, False)):
        (looped,) = validate_arm(model, values, [one], LOOP)
        assert (min(check.fit for check in looped.checks) > 97.0) == fits
        (forces,) = compare_forces(model, values, [one])
        assert (min(check.fit for check in forces.checks) > 97.0) == fits
    changing = full.edited({"load_tool": (np.arange(full.n) > 900).astype(float)})
    with pytest.raises(DataError, match=r"load_tool.* changes within the record.*cut the record there"):
        validate_arm(model, values, [changing], LOOP)
    with pytest.raises(DataError, match="did you mean tool"):
        simulate_arm(model, values, payloads=["tol"], **options)
