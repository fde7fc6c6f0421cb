"""What images of a held command add: against their sum, and taken off readings of a simulated chain."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac
from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.explanation.commands.held_images import felt_at_once, folded
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.two_mass_records import SMALL, TRUTH

DRIVEN_TRUTH = {"J_m": 1e-3, "F_vm": 2e-3, "F_sm": 0.1, "J_c": 1.5e-3, "K": 60.0, "D": 0.02}

FREQUENCY = np.array([0.02, 0.1, 0.2, 0.3])  # cycles a sample


@pytest.mark.parametrize("late", [0.0, 0.04, -0.3, -1.0])
@pytest.mark.parametrize("state", [0, 1, 2, 3])
def test_the_images_are_those_of_all_multiples_of_the_sampling_frequency(late: float, state: int) -> None:
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-9e3, 9e3, -4.0, 3.0], [4e4, -4e4, 1.0, -2.0]], dtype=float)
    B, C, fs = np.array([0.0, 0.0, 5.0, 0.0]), np.eye(4)[state], 500.0
    n = np.arange(1.0, 3000.0)
    sums = []
    for f in FREQUENCY:
        image = f + np.concatenate([n, -n])
        s = 2j * np.pi * fs * image
        states = np.linalg.solve(s[:, None, None] * np.eye(4) - A, np.tile(B[:, None], (len(s), 1, 1)))
        sums.append(np.sum(states[..., 0] @ C * f / image * np.exp(2j * np.pi * late * image)))
    # what is beyond the last image is less than a thousandth
    np.testing.assert_allclose(folded(A, B, C, fs, late)(FREQUENCY), sums, rtol=1e-3)


def test_a_constant_command_has_no_images() -> None:
    found = folded(np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([0.0, 1.0]), np.array([1.0, 0.0]), 100.0)
    assert found(np.array([0.0])) == 0.0


@pytest.mark.slow
def test_a_drive_sampled_slowly_has_the_true_stiffness() -> None:
    # not six samples a period of the mode: images of the command bend K by a tenth of a percent
    record = simulate(SMALL, TRUTH, "chirp", fs=700.0, duration_s=3.0, drive=Drive(rate_hz=700.0)).record
    estimate = identify(SMALL, record, Auto(held=("Gamma_m",)), checks=CheckOptions(tests=False))
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] / TRUTH[name] - 1.0) < 1e-4


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
"""


def test_only_what_is_on_the_driven_body_feels_its_force_at_once() -> None:
    model = spec_model(parse_spec(DRIVEN, "driven.toml"), "s")
    assert felt_at_once(model, ("T",)) == ["a_m"]
    assert felt_at_once(model_from_module(emps300_qm_ac), ("Gamma_m",)) == []
    assert felt_at_once(SMALL, ("Gamma_m",)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("read", "told"), [("after", ()), ("before", ()), ("before", ("T",))])
def test_an_accelerometer_on_the_driven_body_reads_steps_of_the_command(
    read: str, told: tuple[str, ...]
) -> None:
    # J_m came out 0.05 % off with 1e-5 % stated, and D not at all
    model, truth = spec_model(parse_spec(DRIVEN, "driven.toml"), "s"), dict(DRIVEN_TRUTH)
    record = simulate(model, truth, "chirp", fs=2000.0, duration_s=0.6, drive=Drive(rate_hz=2000.0)).record
    if read == "before":
        steps = np.diff(record.signals["T"], prepend=record.signals["T"][0])
        record = record.edited({"a_m": record.signals["a_m"] - steps / truth["J_m"]})
    estimate = identify(model, record, Auto(held=told))
    for name, value in truth.items():
        assert estimate.params[name] == pytest.approx(value, rel=1e-4)
    said = [one.what for one in estimate.checks.advice if one.where == "T"]
    assert told or f"is held over every sample, and a_m read just {read} it changes" in said[0]
