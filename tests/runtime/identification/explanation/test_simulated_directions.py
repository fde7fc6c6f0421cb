"""Directions near reversals from a simulation: a motor that swings about rest, both encoders."""

from __future__ import annotations

from functools import cache

import numpy as np

from modelgen.runtime.identification.identify import identify
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

[sensors.both]
q_m = { body = "m", measures = "position" }
q_l = { body = "l", measures = "position" }
"""
TRUTH = {"J_m": 4e-3, "F_vm": 2e-3, "F_sm": 0.05, "J_l": 5e-3, "D": 0.02, "K": 44.0}
FS, BETWEEN = 1000.0, 8
PLACES = [(4.3, 0.02, 0.0), (7.9, 0.02, 1.0), (11.0, 0.015, 2.0), (15.0, 0.01, 4.0), (21.0, 0.006, 5.0)]


@cache
def servo() -> Model:
    return model_of(SERVO, "both")


@cache
def swinging(seed: int) -> Record:
    """Return 5 s of a motor that reverses some twenty times a second: every sample feels a reversal."""
    t = np.arange(5 * int(FS) * BETWEEN + 1) / (FS * BETWEEN)
    waves = [(2.0 * np.pi * f, size, phase) for f, size, phase in PLACES]
    place = np.sum([size * np.sin(w * t + phase) for w, size, phase in waves], axis=0)
    rate = np.sum([w * size * np.cos(w * t + phase) for w, size, phase in waves], axis=0)
    excitation = Excitation(place, rate, np.zeros_like(t), BETWEEN * FS, "swing")
    clean = simulate(servo(), TRUTH, excitation, fs=FS).record
    rng = np.random.default_rng(seed)
    levels = {"q_m": 1e-6, "q_l": 1e-6, "T": 0.01 * float(np.std(clean.signals["T"]))}
    noisy = {key: clean.signals[key] + level * rng.standard_normal(clean.n) for key, level in levels.items()}
    return Record(noisy, FS, "swing")


def test_friction_at_reversals_is_known_from_a_simulation() -> None:
    found = identify(servo(), swinging(5))
    assert any("directions near reversals are those of a simulation" in note for note in found.fit.notes)
    for entry in found.parameters.physical:
        assert abs(entry.value - TRUTH[entry.name]) < 3.0 * entry.std
    # with signs of the low-passed velocity F_sm had no number, and D was known to 25 %, K to 0.3 %
    spread = {entry.name: entry.std / TRUTH[entry.name] for entry in found.parameters.physical}
    assert spread["F_sm"] < 0.05
    assert spread["D"] < 0.01
    assert spread["K"] < 0.001
