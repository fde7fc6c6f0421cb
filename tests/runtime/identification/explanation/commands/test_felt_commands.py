"""Accelerometers on a driven body, read as a held command changes: how it is held is found, or left open."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac
from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.explanation.commands.felt_commands import felt_at_once
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.two_mass_records import SMALL

DRIVEN_TRUTH = {"J_m": 1e-3, "F_vm": 2e-3, "F_sm": 0.1, "J_c": 1.5e-3, "K": 60.0, "D": 0.02}

DRIVEN = """
[chain]
name = "driven"
motion = "rotation"

[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "T"

[[bodies]]
name = "c"
inertia = "J_c"

[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"

[sensors.s]
a_m = { body = "m", measures = "acceleration" }
q_c = { body = "c", measures = "position" }

[sensors.motor]
q_m = { body = "m", measures = "position" }
a_m = { body = "m", measures = "acceleration" }
"""


def test_only_what_is_on_the_driven_body_feels_its_force_at_once() -> None:
    model = _model("s")
    assert felt_at_once(model, ("T",)) == ["a_m"]
    assert felt_at_once(model_from_module(emps300_qm_ac), ("Gamma_m",)) == []
    assert felt_at_once(SMALL, ("Gamma_m",)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("read", "told"), [("after", ()), ("before", ()), ("before", ("T",))])
def test_an_accelerometer_on_the_driven_body_reads_steps_of_the_command(
    read: str, told: tuple[str, ...]
) -> None:
    # J_m came out 0.05 % off with 1e-5 % stated, and D not at all
    model, truth = _model("s"), dict(DRIVEN_TRUTH)
    record = simulate(model, truth, "chirp", fs=2000.0, duration_s=0.6, drive=Drive(rate_hz=2000.0)).record
    if read == "before":
        steps = np.diff(record.signals["T"], prepend=record.signals["T"][0])
        record = record.edited({"a_m": record.signals["a_m"] - steps / truth["J_m"]})
    estimate = identify(model, record, Auto(held=told))
    for name, value in truth.items():
        assert estimate.params[name] == pytest.approx(value, rel=1e-4)
    said = [one.what for one in estimate.checks.advice if one.where == "T"]
    assert told or f"is held over every sample, and a_m read just {read} it changes" in said[0]


def _model(sensors: str) -> Model:
    return spec_model(parse_spec(DRIVEN, "driven.toml"), sensors)


@pytest.mark.slow
@pytest.mark.parametrize("times", [2, 5])
def test_a_controller_that_acts_more_often_than_it_is_recorded_holds_its_command_for_a_part(
    times: int,
) -> None:
    # D came out 27 and 11 % off: half of the hold is damping to what feels the command at once
    model, fs = _model("s"), 2000.0
    drive = Drive(rate_hz=times * fs)
    every = simulate(model, DRIVEN_TRUTH, "chirp", fs=times * fs, duration_s=1.0, drive=drive).record
    record = Record({key: samples[::times] for key, samples in every.signals.items()}, fs, "every other")
    estimate = identify(model, record)
    for name, value in DRIVEN_TRUTH.items():
        assert abs(estimate.params[name] / value - 1.0) < 2e-3
    told = [one.what for one in estimate.checks.advice if one.where == "T"]
    assert f"is held over {1.0 / times:.2g} of a sample, and a_m read just after it changes" in told[0]


@pytest.mark.slow
def test_a_hold_that_hardly_shows_is_in_the_intervals() -> None:
    # beside a load that no sensor sees, a command felt at once is damping: D / K was off by 4.8 deviations
    model, fs, rng = _model("motor"), 2000.0, np.random.default_rng(3)
    drive, name = Drive(rate_hz=fs), "D/K"
    signals = dict(simulate(model, DRIVEN_TRUTH, "chirp", fs=fs, duration_s=2.0, drive=drive).record.signals)
    for key, noise in (("q_m", 1e-5), ("a_m", 0.3)):
        signals[key] = signals[key] + noise * rng.standard_normal(len(signals[key]))
    estimate = identify(model, Record(signals, fs, "chirp"))
    found, std = estimate.params[name], estimate.bse[name]
    assert abs(found - DRIVEN_TRUTH["D"] / DRIVEN_TRUTH["K"]) < 2.0 * std < found
    note = "T is held over every sample, and a_m read as it changes, hardly shows"
    assert any(note in one for one in estimate.fit.notes)
