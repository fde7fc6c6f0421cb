"""Directions from a wider band, where a low-pass at the dynamics turns them at other instants than a body."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.options import Filters
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.iv.shapes.chains import TWO
from tests.runtime.two_mass_records import FS, SMALL

TRUTH = dict(SMALL.parameter_sets["table_2"])


@cache
def sines(force_noise: float) -> Record:
    """Return 6 s of seven sines, the highest with most of the acceleration, and what drives them."""
    rng = np.random.default_rng(0)
    n = 30_000
    t = np.arange(n) / FS
    motor, load = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
    speed, acceleration, pulled = np.zeros(n), np.zeros(n), np.zeros(n)
    for hz in (0.31, 1.7, 7.3, 23.0, 61.0, 109.0, 167.0):
        s = 2j * np.pi * hz
        line = np.exp(s * t + 1j * rng.uniform(0.0, 6.0)) * (2.0 / (hz + hz**2 / 30.0))
        driven = line * (1.0 + s**2 * TRUTH["J_c"] / (TRUTH["K"] + s * TRUTH["F_vmc"]))
        motor, load = motor + driven, load + line
        speed, acceleration = speed + (s * driven).imag, acceleration + (s**2 * driven).imag
        pulled += TRUTH["J_c"] * (s**2 * line).imag
    torque = TRUTH["J_m"] * acceleration + TRUTH["F_vm"] * speed + TRUTH["F_sm"] * np.sign(speed) + pulled
    read = {"q_m": motor.imag, "q_c": load.imag}
    signals = {key: one + 1e-5 * rng.standard_normal(n) for key, one in read.items()}
    return Record(signals | {"Gamma_m": torque + force_noise * rng.standard_normal(n)}, FS, "sines")


def test_friction_is_known_where_what_moves_most_is_at_the_end_of_the_band() -> None:
    found = identify(SMALL, sines(1e-3))
    for name, value in TRUTH.items():
        assert abs(found.params[name] - value) < 3.5 * found.bse[name]
    # behind a low-pass at 167 Hz viscous friction was 38 % too large, stated as 38 %, and the load 13 %
    assert found.bse["F_vm"] < 0.05 * TRUTH["F_vm"]
    assert found.bse["J_c"] < 0.03 * TRUTH["J_c"]


def test_noise_behind_a_high_cutoff_does_not_hide_it() -> None:
    found = identify(SMALL, sines(1e-3), filters=Filters(cutoff_hz=1000.0))
    assert abs(found.params["F_vm"] - TRUTH["F_vm"]) < 3.5 * found.bse["F_vm"]
    # judged behind 1 kHz the narrow band stayed, at twice that error
    assert found.bse["F_vm"] < 0.04 * TRUTH["F_vm"]


SPEEDS = (
    TWO
    + """
[sensors.s]
v_m = { body = "m", measures = "velocity" }
v_c = { body = "c", measures = "velocity" }
"""
)
WINDER = {"J_m": 0.02, "F_vm": 0.01, "F_sm": 0.4, "J_c": 0.06, "K": 180.0, "D": 0.25}


def test_reversals_that_a_low_pass_swallows_are_seen_in_a_wider_band() -> None:
    model = spec_model(parse_spec(SPEEDS, "two.toml"), "s")
    t = np.arange(96_001) / 8000.0
    # reversals follow one another where the slow wave turns, at up to 31 Hz
    rate = 30.0 * np.sin(0.8 * np.pi * t) + 6.0 * np.sin(2.0 * np.pi * (2.0 + 1.2 * t) * t)
    path, force = np.cumsum(rate) / 8000.0, 0.08 * np.gradient(rate, t)
    chirp, noise = Excitation(path, rate, force, 8000.0, "chirp"), {"v_m": 0.01, "v_c": 0.01, "T": 0.02}
    speed = PositionVelocityController(0.0, 1.5)
    found = identify(model, simulate(model, WINDER, chirp, fs=1000.0, controller=speed, noise=noise).record)
    assert not [one for one in found.checks.advice if one.kind == "more than noise"]
    for name, value in WINDER.items():
        assert abs(found.params[name] - value) < 3.5 * found.bse[name]
    # with directions below 26 Hz few samples seemed to feel a reversal, and friction was known to 30 %
    assert found.bse["F_sm"] < 0.01 * WINDER["F_sm"]


@pytest.mark.slow
def test_a_band_that_was_given_stays_and_one_that_noise_drowns() -> None:
    given = identify(SMALL, sines(1e-3), IV(), Filters(direction_cutoff_hz=167.0))
    assert given.fit.filtering.direction_cutoff_hz == 167.0
    loud = identify(SMALL, sines(2e-2))
    assert not any("narrower band" in one for one in loud.fit.filtering.sentences)
