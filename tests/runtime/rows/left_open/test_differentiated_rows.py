"""Differentiated rows of arms: what friction jumps by at a reversal is left open, and not masked."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen import CheckOptions, Record, identify
from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.rows.left_open.uncertain_turns import leaves_turns_open, without_uncertain_turns
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.rows.left_open.test_long_rests import FS, STICKING, model_of, read_by

MOTOR_SPEED, LINK_SPEED = ("motor", "velocity"), ("link", "velocity")
# of a motor, in kg m^2 and N m, and frequencies of its motion in Hz: it turns eight times a second
INERTIA, COULOMB, TONES_HZ, CUTOFF_HZ = 2.0, 3.0, (0.7, 1.9, 4.1), 25.0


def turning(duration_s: float) -> FloatArray:
    """Return speed and acceleration of two joints that turn often, shape (2, 2, N), in SI."""
    t, found = np.arange(0.0, duration_s, 1.0 / FS), []
    for start in (0.0, 1.0):
        rates = [2.0 * np.pi * hertz for hertz in TONES_HZ]
        speed = sum(np.sin(w * t + start * k) for k, w in enumerate(rates, 1))
        found.append((speed, sum(w * np.cos(w * t + start * k) for k, w in enumerate(rates, 1))))
    return np.array(found).swapaxes(0, 1)


def spring_rows(opened: bool) -> list[RowBlock]:
    """Return the rows of motors that move so with their links, which feel inertia and friction only."""
    model, (speed, acceleration) = model_of(MOTOR_SPEED, LINK_SPEED), turning(8.0)
    signals = {}
    for joint in range(2):
        signals |= {f"{side}_velocity_{joint + 1}": speed[joint] for side in ("motor", "link")}
        signals[f"tau_{joint + 1}"] = INERTIA * acceleration[joint] + COULOMB * np.sign(speed[joint])
    record = Record(signals, FS, "turning")
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    if not opened:
        return list(observe(model, [record], choice).blocks)
    rows = observe(model, [record], choice, turns="open")
    return list(without_uncertain_turns(rows, model, [record], choice, 0).blocks)


def test_all_that_feels_a_reversal_is_hardly_less_than_everything() -> None:
    assert leaves_turns_open(model_of(MOTOR_SPEED, LINK_SPEED))
    for masked, opened in zip(spring_rows(False), spring_rows(True), strict=True):
        assert masked.count < 0.1 * masked.grid
        assert opened.count - opened.opened > 0.5 * opened.grid


def test_what_friction_jumps_by_is_in_no_row() -> None:
    names = model_of(MOTOR_SPEED, LINK_SPEED).base_parameters
    for row in spring_rows(True):
        truth = np.array([INERTIA * (name == f"Ia_{row.row + 1}") for name in names])
        assert float(np.std(row.residual(truth))) < 0.02 * float(np.std(row.Y))


@pytest.mark.slow
def test_speeds_of_both_sides_tell_motors_and_springs() -> None:
    t, (speed, _) = np.arange(8.0 * FS) / FS, turning(8.0)
    start = np.clip(t / 0.7, 0.0, 1.0)
    position = 0.3 * start**3 * (10.0 - 15.0 * start + 6.0 * start**2) * np.cumsum(speed, axis=1) / FS
    motion = np.array([position, np.gradient(position, 1.0 / FS, axis=1), np.zeros_like(position)])
    motion[2] = np.gradient(motion[1], 1.0 / FS, axis=1)
    model, record = read_by((MOTOR_SPEED, LINK_SPEED), motion, {"rad/s": 1e-3, "N m": 0.05})
    found, names = identify(model, record, checks=CheckOptions(tests=False)), model.base_parameters
    truth = model.base_from_physical({name: STICKING[name] for name in model.parameters})
    assert set(found.params) == set(names)
    off = {n: (found.params[n] - x) / found.bse[n] for n, x in zip(names, truth, strict=True)}
    assert max(abs(one) for one in off.values()) < 4.0, off
    assert all(found.bse[f"K_{joint}"] < 0.02 * found.params[f"K_{joint}"] for joint in (1, 2))
