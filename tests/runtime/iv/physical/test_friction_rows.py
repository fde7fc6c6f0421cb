"""Friction in differentiated rows: a motor that swings about rest, seen by its own encoder alone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.physical.friction_rows import mean_direction, mean_sign, turning_points
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from tests.runtime.iv.physical.swinging_servo import FS, TRUTH, servo, swung

PLACES = [(0.7, 0.3, 0.0), (1.9, 0.1, 1.0), (4.3, 0.07, 2.0), (11.0, 0.03, 4.0), (21.0, 0.006, 5.0)]


@cache
def swinging() -> Record:
    """Return 5 s of a motor that reverses a dozen times a second, noisy."""
    clean = swung(servo(), TRUTH, PLACES, 5)
    rng = np.random.default_rng(5)
    step = 2.0 * np.pi / 2**17
    signals = dict(clean.signals)
    signals["q_m"] = step * np.round(signals["q_m"] / step)
    signals["T"] = signals["T"] + 0.01 * np.std(signals["T"]) * rng.standard_normal(clean.n)
    return Record(signals, FS, "swing")


def test_a_jump_between_samples_is_where_it_is() -> None:
    # low-passed by a Gaussian of ten samples, a jump at any part of a sample is that of the error function
    k = np.arange(-60.0, 61.0)
    kernel = np.exp(-0.5 * (k / 10.0) ** 2)
    kernel /= kernel.sum()
    for part in (0.0, 0.2, 0.5, 0.9):
        found = float(mean_sign(k + part) @ kernel)
        true = 2.0 * (part / 10.0) / np.sqrt(2.0 * np.pi) * (1.0 - (part / 10.0) ** 2 / 6.0)
        plain = float(np.sign(k + part) @ kernel)
        assert abs(found - true) < 1e-4
        assert part in (0.0, 0.5) or abs(plain - true) > 5e-3
    assert mean_sign(np.zeros(9)).tolist() == [0.0] * 9


def test_a_speed_bends_where_it_passes_zero() -> None:
    # friction that jumps makes the speed three times as slow behind its zero as before it
    k = np.arange(-5.0, 6.0)
    for part in (0.1, 0.5, 0.8):
        before = k < part
        speed = np.where(before, 3.0 * (part - k), part - k)
        change = np.where(before, -3.0, -1.0)
        at, bent = turning_points(speed, change)
        _, straight = turning_points(speed)
        assert at.tolist() == [5]
        assert abs(bent[0] - part) < 1e-12
        assert straight[0] > part + 0.05
        found = mean_direction(speed, change)
        assert found[:5].tolist() == [1.0] * 5
        assert abs(found[5] - (2.0 * part - 1.0)) < 1e-12
        assert found[6:].tolist() == [-1.0] * 4
    # at rest for a sample, or with slopes of rounding, it is a straight line
    flat = np.array([1.0, -1.0])
    assert turning_points(flat, np.zeros(2))[1].tolist() == [0.5]


@pytest.mark.slow
def test_a_motor_about_rest_is_known_from_its_own_encoder() -> None:
    record = swinging()
    choice = choose_filter(servo(), [record])
    # rows that drop the friction have no sample left
    assert observe(servo(), [record], choice, turns=False).blocks[0].count == 0
    assert observe(servo(), [record], choice, turns=False, friction=True).blocks[0].turning
    found = identify(servo(), record)
    assert any("method iv, in the physical parameters" in note for note in found.fit.notes)
    known = {entry.name: entry for entry in found.parameters.physical}
    assert list(known) == list(servo().parameters)
    for name, value in TRUTH.items():
        assert abs(known[name].value - value) < 3.0 * known[name].std
    for name, percent in {"J_m": 0.5, "J_l": 0.5, "K": 0.5, "D": 10.0, "F_sm": 5.0}.items():
        assert known[name].relative_std < percent
