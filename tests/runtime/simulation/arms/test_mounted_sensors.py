"""Sensors of an arm along its motion: against positions of frames, differentiated twice."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.cli.arms.simulate_arm import arm_model, mounted
from modelgen.runtime.simulation.arms.arm_plant import arm_plant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor, sensor_channels
from tests.runtime.made_arm_records import written

ARM = """
[arm]
name = "mixed"
gravity = [0, 1, -9.81]
[[joints]]
name = "a"
alpha = 30
r = 0.3
stiffness = true
[[joints]]
name = "b"
type = "prismatic"
alpha = -60
d = 0.2
[[joints]]
name = "c"
alpha = 45
d = 0.4
r = 0.1
gear = 20
stiffness = true
[[joints]]
name = "tool"
type = "fixed"
parent = "c"
xyz = [0.1, 0.0, 0.2]
rpy = [20, 0, 10]
[sensors.s]
g = { joint = "tool", side = "link", measures = "gyro", rpy = [10, 20, 30] }
f = { joint = "tool", side = "link", measures = "accelerometer", xyz = [0.05, 0.1, -0.02], rpy = [0, 40, 0] }
m = { joint = "c", side = "motor", measures = "velocity" }
d = { deflection = "c", measures = "position" }
t = { joint = "c", measures = "torque" }
"""


def frame(sensor: MountedSensor, q: dict[str, float]) -> np.ndarray:
    found = np.eye(4)
    for joint in sensor.way:
        moved = np.eye(4)
        if joint.kind == "prismatic":
            moved[2, 3] = q[joint.name]
        elif joint.kind == "revolute":
            c, s = np.cos(q[joint.name]), np.sin(q[joint.name])
            moved[:2, :2] = [[c, -s], [s, c]]
        found = found @ joint.placement @ moved
    return found


def test_sensors_read_what_moved_frames_say() -> None:
    spec = written(ARM)
    model = arm_model(spec)
    values = dict.fromkeys(model.parameters, 0.3) | {"K_a": 900.0, "K_c": 700.0}
    plant = arm_plant(model, model.base_from_physical(values))
    assert plant.coordinates.names == ("a", "b", "c", "a motor", "c motor")
    rng = np.random.default_rng(2)
    q0, v0, a0 = rng.uniform(-1.0, 1.0, (3, 5))
    read = sensor_channels(
        plant, mounted(spec, "s"), JointMotion(*(one[:, None] for one in (q0, v0, a0)), 1.0)
    )
    gyro, accelerometer, *_ = mounted(spec, "s")

    def at(sensor: MountedSensor, time: float) -> np.ndarray:
        q = q0 + time * v0 + 0.5 * time**2 * a0
        return frame(sensor, dict(zip("abc", q, strict=False)))

    h = 1e-4
    before, here, after = (at(accelerometer, t) for t in (-h, 0.0, h))
    risen = (before[:3, 3] - 2.0 * here[:3, 3] + after[:3, 3]) / h**2 - np.array([0.0, 1.0, -9.81])
    felt = [read[f"f_{axis}"][0] for axis in "xyz"]
    np.testing.assert_allclose(felt, here[:3, :3].T @ risen, atol=1e-6)
    before, here, after = (at(gyro, t)[:3, :3] for t in (-h, 0.0, h))
    spin = here.T @ (after - before) / (2.0 * h)
    turned = [read[f"g_{axis}"][0] for axis in "xyz"]
    np.testing.assert_allclose(turned, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6)
    assert read["m"][0] == pytest.approx(20.0 * v0[4])
    assert read["d"][0] == pytest.approx(q0[4] - q0[2])
    assert read["t"][0] == pytest.approx(700.0 * (q0[4] - q0[2]))
