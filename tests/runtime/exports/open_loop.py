"""Our own motion of a chain under given forces: what every exported model must repeat."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

FS = 5000.0

# two bodies with a gear, friction that sticks, an offset, a relative sensor, every order of sensor
GEARED = """
chain = { name = "geared", title = "<b>\\"A -- gear\\"</b>", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "B_m", coulomb = "F_m", actuator = "T" },
    { name = "t", inertia = "M_t", viscous = "B_t", coulomb = "F_t", offset = "O_t", motion = "translation" },
]
links = [
    { bodies = ["m", "t"], stiffness = "K", damping = "D", lead = 0.02 },
    { bodies = ["t", "ground"], stiffness = "K_g" },
]
[parameters.nominal]
J_m = 2e-4
B_m = 1e-3
F_m = 0.05
M_t = 10.0
B_t = 30.0
F_t = 8.0
O_t = 3.0
K = 4e6
D = 800.0
K_g = 500.0
[sensors.all]
q_m = { body = "m", measures = "position" }
v_t = { body = "t", measures = "velocity" }
a_t = { body = "t", measures = "acceleration" }
stretch = { deflection = ["m", "t"], measures = "position" }
"""


def model_of(text: str, sensors: str = "all") -> Model:
    return model_from_text(generate(parse_spec(text, "chain.toml"), sensors), "chain")


def force(model: Model, seconds: float, size: float, slow_hz: float = 3.0) -> Excitation:
    """Return a force that reverses, rests below friction, and is piecewise linear between samples."""
    t = np.arange(round(seconds * FS) + 1) / FS
    wave = np.sin(2 * np.pi * slow_hz * t) + 0.2 * np.sin(2 * np.pi * 31.0 * t + 0.4)
    wave = np.where((t > 0.45 * seconds) & (t < 0.6 * seconds), 0.05, wave)
    others = {actuator.key: 0.3 * size * np.cos(9.0 * t) for actuator in model.actuators[1:]}
    return Excitation(np.zeros(len(t)), np.zeros(len(t)), size * wave, FS, "push", others)


def motion(model: Model, values: Mapping[str, float], push: Excitation) -> dict[str, FloatArray]:
    """Return readings and all `true` signals of the motion without a controller."""
    free = PositionVelocityController(0.0, 0.0)
    return dict(simulate(model, values, push, fs=FS, controller=free).true)


def error(found: FloatArray, expected: FloatArray) -> float:
    """Return the rms error relative to the rms of what is expected."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
