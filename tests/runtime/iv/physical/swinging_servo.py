"""A motor that swings about rest, with a load on a spring: every sample feels a reversal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import model_of

SERVO = """
chain = { name = "servo", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "l", inertia = "J_l" },
]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D" }]

[sensors.motor]
q_m = { body = "m", measures = "position" }
"""
TRUTH = {"J_m": 4e-3, "F_vm": 2e-3, "F_sm": 0.05, "J_l": 5e-3, "D": 0.02, "K": 44.0}
FS, BETWEEN = 1000.0, 8


@cache
def servo() -> Model:
    return model_of(SERVO, "motor")


def swung(
    model: Model, truth: Mapping[str, float], places: Sequence[tuple[float, float, float]], seconds: int
) -> Record:
    """Return the motion without noise along a sum of sines: frequency in Hz, size and phase in rad."""
    t = np.arange(seconds * int(FS) * BETWEEN + 1) / (FS * BETWEEN)
    waves = [(2.0 * np.pi * f, size, phase) for f, size, phase in places]
    place = np.sum([size * np.sin(w * t + phase) for w, size, phase in waves], axis=0)
    rate = np.sum([w * size * np.cos(w * t + phase) for w, size, phase in waves], axis=0)
    excitation = Excitation(place, rate, np.zeros_like(t), BETWEEN * FS, "swing")
    return simulate(model, truth, excitation, fs=FS).record
