"""Closed-loop validation: perfect on its own simulation, and on the EMPS bench below the published errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, emps_rigid_qm, two_mass_bench_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, default_controller
from modelgen.runtime.simulation.controller_file import load_controller
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.validate import parameters_of, split, validate

AC, RIGID = model_from_module(emps300_qm_ac), model_from_module(emps_rigid_qm)
LIGHT = AC.parameter_sets["light"]
PUBLISHED = {"position": 0.01375, "velocity": 0.229, "acceleration": 8.60, "force": 5.85}
CONTROLLER = """
[controller]
position_gain = 160.18
velocity_gain = 243.45
force_gain = 35.15065188

[drive]
rate_hz = 1000.0
velocity = "central"
"""


def simulated() -> Record:
    """A record of the closed loop, with what drove it."""
    found = simulate(AC, LIGHT, "chirp", duration_s=1.0)
    reference = {
        key: getattr(found.reference, key)[:: found.settings.oversample]
        for key in ("reference", "reference_rate", "feedforward")
    }
    return Record({**found.record.signals, **reference}, found.record.fs, "mine")


def test_a_simulation_validates_itself() -> None:
    record = simulated()
    loop = default_controller(make_plant(AC, LIGHT))
    (found,) = validate(AC, LIGHT, [record], loop, used=["mine"])
    assert not found.held_out
    assert [(c.channel, c.kind, c.derived) for c in found.checks] == [
        ("q_m", "position", False),
        ("q_m", "velocity", True),
        ("q_m", "acceleration", True),
        ("a_c", "acceleration", False),
        ("q_m", "tracking error", False),
        ("Gamma_m", "force", False),
    ]
    assert [c.unit for c in found.checks[:3]] == ["rad", "rad/s", "rad/s^2"]
    # but for the input between the samples, which a record does not hold
    assert found.check("q_m", "position").relative_error < 1e-3
    assert found.check("a_c", "acceleration").fit > 99.0
    (worse,) = validate(AC, {**LIGHT, "K": 1.2 * LIGHT["K"]}, [record], loop)
    assert worse.held_out
    assert worse.check("a_c", "acceleration").fit < 90.0


def test_figures_are_what_they_say() -> None:
    record = simulated()
    (found,) = validate(
        AC, {**LIGHT, "K": 1.2 * LIGHT["K"]}, [record], default_controller(make_plant(AC, LIGHT))
    )
    check = found.check("a_c", "acceleration")
    error = np.linalg.norm(check.measured - check.simulated)
    assert check.relative_error == pytest.approx(100.0 * error / np.linalg.norm(check.measured))
    assert check.fit == pytest.approx(
        100.0 * (1.0 - error / np.linalg.norm(check.measured - check.measured.mean()))
    )
    assert check.rms_error == pytest.approx(error / np.sqrt(record.n))
    np.testing.assert_array_equal(check.measured, record.signals["a_c"])


def emps(shared_data: Path) -> Record:
    columns = {"q_m": "qm", "F": "vir", "reference": "qg"}
    return read_record(
        shared_data / "emps" / "DATA_EMPS.mat", columns, {"F": "gtau"}, fs=1000.0, needed=tuple(columns)
    )


@pytest.mark.slow
@pytest.mark.parametrize("module", [emps_rigid_qm, emps_rigid_asymmetric_qm])
def test_the_emps_bench_stays_below_every_published_error(
    module: object, shared_data: Path, tmp_path: Path
) -> None:
    path = tmp_path / "loop.toml"
    path.write_text(CONTROLLER)
    loop, drive = load_controller(path)
    model, record = model_from_module(module), emps(shared_data)
    first, rest = split(record, 0.5)
    for used, checked in ((record, record), (first, rest)):
        parameters = identify(model, [used]).physical
        (found,) = validate(model, parameters, [checked], loop, drive=drive, cutoff_hz=100.0)
        for kind, limit in PUBLISHED.items():
            channel = "F" if kind == "force" else "q_m"
            assert found.check(channel, kind).relative_error < limit
        assert found.check("q_m", "position").relative_error < 0.1 * PUBLISHED["position"]
        assert found.check("q_m", "tracking error").fit > 99.5


def test_the_emps_controller_forms_its_velocity_from_central_differences(shared_data: Path) -> None:
    record = emps(shared_data)
    kv = 243.45 * 35.15065188
    loop = PositionVelocityController(160.18 * kv, kv, rate_gain=0.0)
    parameters = RIGID.parameter_sets["published_2019"]
    errors = {}
    for velocity in ("true", "backward", "central"):
        drive = Drive(rate_hz=1000.0, velocity=velocity)
        (found,) = validate(RIGID, parameters, [record], loop, drive=drive, cutoff_hz=100.0)
        errors[velocity] = found.check("q_m", "position").relative_error
    assert errors["central"] < 0.8 * errors["backward"] < 0.8 * errors["true"]


def test_encoders_with_unrelated_zeros_start_where_they_are() -> None:
    model = model_from_module(two_mass_bench_qm_qc)
    p = {**model.parameter_sets["reference"], "Fsm": 0.0, "Fsc": 0.0}
    n = 200
    record = Record(
        {"q_m": np.full(n, 1.0), "q_c": np.full(n, 1.0), "i": np.zeros(n), "reference": np.ones(n)}, 2500.0
    )
    (found,) = validate(model, p, [record], PositionVelocityController(5.0, 0.1))
    np.testing.assert_allclose(found.check("q_c", "position").simulated, 1.0, rtol=1e-9)


def test_a_saved_estimate_gives_its_parameters() -> None:
    saved = {"format": "modelgen estimate", "chain": "emps300", "physical": {"K": 0.3, "J_m": None}}
    assert parameters_of(saved, AC) == {"K": 0.3}
    with pytest.raises(DataError, match="estimate: is of the chain emps300, the model of emps_rigid"):
        parameters_of(saved, RIGID)
    with pytest.raises(DataError, match="estimate: is no saved estimate; give a file that modelgen identify"):
        parameters_of({"physical": {}}, AC)


def test_a_record_without_reference_is_refused() -> None:
    record = simulated().select(["q_m", "a_c", "Gamma_m"])
    with pytest.raises(DataError, match="mine: has no channel reference"):
        validate(AC, LIGHT, [record], PositionVelocityController(1.0, 1.0))
    with pytest.raises(DataError, match=r"cutoff_hz: is 2500; give a frequency between 0 and half"):
        validate(AC, LIGHT, [simulated()], PositionVelocityController(1.0, 0.1), cutoff_hz=2500.0)


def test_a_split_keeps_every_sample_once() -> None:
    record = simulated()
    first, rest = split(record, 0.3)
    assert (first.name, rest.name) == ("mine_first", "mine_rest")
    assert first.n == round(0.3 * record.n)
    np.testing.assert_array_equal(np.r_[first.signals["q_m"], rest.signals["q_m"]], record.signals["q_m"])
    with pytest.raises(DataError, match="split: is 1; give a share between 0 and 1"):
        split(record, 1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[controller]\nkp = 1.0", r"loop.toml: controller.kv: is missing; give kp, kv"),
        ("[controller]\nkp = 1.0\nkv = true", r"loop.toml: controller.kv: is True; give a number"),
        ("[controller]\nkp = 1.0\nkv = 1.0\nkd = 2.0", r"loop.toml: controller: has no key kd"),
        ("[controller]\nposition_gain = 1.0", r"controller.velocity_gain: is missing"),
        ("[controller]\nkp = 1.0\nkv = 1.0\n[drive]\nlimit = -1.0", r"drive: limit: is -1.0"),
        ("[loop]\n[controller]\nkp = 1.0\nkv = 1.0", r"loop.toml: has no table loop"),
        ("drive = 3\n[controller]\nkp = 1.0\nkv = 1.0", r"loop.toml: drive: is no table"),
        ("kp = ", r"loop.toml: .*is not valid TOML"),
    ],
)
def test_wrong_controllers_are_explained(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "loop.toml"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        load_controller(path)


def test_a_controller_in_si_units(tmp_path: Path) -> None:
    path = tmp_path / "loop.toml"
    path.write_text("[controller]\nkp = 3\nkv = 0.5\nrate_gain = 0.0\n[drive]\nbandwidth_hz = 300.0\n")
    assert load_controller(path) == (PositionVelocityController(3.0, 0.5, 0.0), Drive(bandwidth_hz=300.0))
    with pytest.raises(DataError, match=r"cannot be read \(No such file"):
        load_controller(tmp_path / "absent.toml")
