"""An elastic joint that goes from point to point, its motor at rest in between, read at the link alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen import JointController, Record, identify, simulate_arm
from modelgen.cli.arms.simulate_arm import arm_model
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.spec.arms.load import load_arm

FS, DURATION_S = 1000.0, 10.0
VALUES = {"Izz_1": 0.24, "Ia_1": 0.31, "Fv_1": 1.2, "Fs_1": 0.8, "off_1": 0.0, "K_1": 1230.0, "D_1": 1.3}
ARM = """
[arm]
name = "axis"
gravity = [0, 0, -9.81]
drive = ["rotor_inertia", "viscous", "coulomb", "offset", "stiffness", "damping"]

[[joints]]
name = "1"

[sensors.link]
q_1 = { joint = "1", side = "link", measures = "position" }
"""


def models(folder: Path) -> tuple[Model, Model]:
    """Return the model of the link's encoder, and the one that the axis is simulated with."""
    (folder / "axis.toml").write_text(ARM, encoding="utf-8")
    arm = load_arm(folder / "axis.toml")
    ((file, text),) = arm_files(arm, "link").items()
    return model_from_text(text, file), arm_model(arm)


def moves(rng: np.random.Generator) -> JointReference:
    """Return moves of fifth degree between places up to 1 rad from zero, with rests."""
    t, q = np.arange(0.0, DURATION_S, 1.0 / FS), np.zeros((3, int(DURATION_S * FS)))
    begins, at = 0.3, 0.0
    while begins < DURATION_S - 0.5:
        takes, to = rng.uniform(0.15, 0.5), rng.uniform(-1.0, 1.0)
        s = np.clip((t - begins) / takes, 0.0, 1.0)
        shape = (
            s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
            30.0 * (s * (1.0 - s)) ** 2 / takes,
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / takes**2,
        )
        q += (to - at) * np.array(shape)
        begins, at = begins + takes + rng.uniform(0.1, 0.3), to
    return JointReference(JointMotion(*(one[None] for one in q), FS))


@pytest.mark.slow
def test_rests_of_a_motor_that_no_sensor_sees_hide_no_spring(tmp_path: Path) -> None:
    """Directions of a motor are off where its spring is: steps had led to a spring 190 deviations off."""
    model, plant = models(tmp_path)
    rng = np.random.default_rng(102)
    values = {name: VALUES.get(name, 0.0) for name in plant.parameters}
    controller = JointController(bandwidth_hz=6.0)
    moved = simulate_arm(plant, values, moves(rng), fs=FS, controller=controller).true
    force = moved["tau_1"]
    read = {
        "q_1": moved["q_1"] + 5e-6 * rng.standard_normal(len(force)),
        "tau_1": force + 0.1 * rng.standard_normal(len(force)),
    }
    found = identify(model, Record(read, FS, "moves"))
    off = {name: (found.params[name] - VALUES[name]) / found.bse[name] for name in found.params}
    assert max(abs(one) for one in off.values()) < 4.0, off
    assert found.relative_std["K_1"] < 3.0
