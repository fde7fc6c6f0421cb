"""Sampling, delay, current loop, limit and encoder: against solvers and recursions written out here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from generated import emps300_qm_ac, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate

EMPS = model_from_module(emps300_qm_ac)
RIGID = model_from_module(emps_rigid_qm)
SLIDES = {"M": 95.0, "Fv": 200.0, "Fc": 0.0, "offset": 0.0}
LOOP = PositionVelocityController(kp=4e5, kv=8e3)
FS = 1000.0


def wave(oversample: int = 1, samples: int = 400) -> Excitation:
    t = np.arange((samples - 1) * oversample + 1) / (FS * oversample)
    return Excitation(
        0.02 * (1.0 - np.cos(15.0 * t)), 0.3 * np.sin(15.0 * t), 20.0 * np.sin(40.0 * t), FS * oversample
    )


def recursion(drive: Drive, per_tick: int = 1, delay: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Position and command of a sampled loop without friction, one zero-order hold after another."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, -SLIDES["Fv"] / SLIDES["M"], 1.0 / SLIDES["M"]], [0.0] * 3])
    step = expm(A / FS)
    given, x, seen = wave(), np.zeros(2), [0.0, 0.0]
    positions, commands = [], []
    for k in range(given.t.size):
        if k % per_tick == 0:
            q = x[0]
            if drive.encoder_step:
                q = drive.encoder_step * np.floor(q / drive.encoder_step + 0.5)
            tick_s = per_tick / FS
            v = {
                "true": x[1],
                "backward": (q - seen[0]) / tick_s,
                "central": (q - seen[1]) / (2.0 * tick_s),
            }[drive.velocity]
            seen = [q, seen[0]]
            force = LOOP.kp * (given.reference[k] - q) + LOOP.kv * (given.reference_rate[k] - v)
            force = np.clip(force + given.feedforward[k], -drive.limit, drive.limit)
        commands.append(force)
        positions.append(x[0])
        acting = commands[k - delay] if k >= delay else 0.0
        x = (step @ np.r_[x, acting])[:2]
    return np.array(positions), np.array(commands)


@pytest.mark.parametrize(
    ("options", "per_tick", "delay"),
    [
        ({"rate_hz": FS}, 1, 0),
        ({"velocity": "backward"}, 1, 0),
        ({"velocity": "central", "encoder_step": 1e-5}, 1, 0),
        ({"rate_hz": FS / 4}, 4, 0),
        ({"delay_s": 2e-3}, 1, 2),
        ({"limit": 120.0, "delay_s": 1e-3, "rate_hz": 500.0}, 2, 1),
    ],
)
def test_a_sampled_loop_is_the_recursion_of_its_samples(
    options: dict[str, Any], per_tick: int, delay: int
) -> None:
    drive = Drive(**options)
    found = simulate(RIGID, SLIDES, wave(), fs=FS, controller=LOOP, drive=drive).true
    position, command = recursion(drive, per_tick, delay)
    np.testing.assert_allclose(found["q_m"], position, atol=1e-12)
    np.testing.assert_allclose(found["command_F"], command, atol=1e-6)
    late = np.r_[np.zeros(delay), command[: command.size - delay]]
    np.testing.assert_allclose(found["F"], late, atol=1e-6)
    assert np.abs(command).max() <= drive.limit
    if drive.limit < np.inf:
        assert (np.abs(command) == drive.limit).sum() > 10


def test_a_delay_of_part_of_a_sample() -> None:
    fine = Drive(delay_s=0.25e-3)
    found = simulate(RIGID, SLIDES, wave(4), fs=FS, controller=LOOP, drive=fine).true
    at_once, late = (
        simulate(RIGID, SLIDES, wave(), fs=FS, controller=LOOP, drive=Drive(rate_hz=FS, delay_s=d)).true
        for d in (0.0, 1e-3)
    )
    between = (found["q_m"] - at_once["q_m"])[50:] / (late["q_m"] - at_once["q_m"])[50:]
    assert np.median(between) == pytest.approx(0.25, abs=0.05)
    with pytest.raises(DataError, match=r"drive: delay_s: is 0.25 internal steps of 0.001 s"):
        simulate(RIGID, SLIDES, wave(), fs=FS, controller=LOOP, drive=fine)


@pytest.mark.parametrize("rate_hz", [None, FS])
def test_a_current_loop_agrees_with_an_ode_solver(rate_hz: float | None) -> None:
    p = {**EMPS.parameter_sets["light"], "F_sm": 0.0}
    loop, tau = PositionVelocityController(kp=0.1, kv=1e-3), 1.0 / (2.0 * np.pi * 50.0)
    t = np.arange(201) / FS
    given = Excitation(2.0 * (1.0 - np.cos(20.0 * t)), 40.0 * np.sin(20.0 * t), 0.02 * np.sin(300.0 * t), FS)
    drive = Drive(bandwidth_hz=50.0, rate_hz=rate_hz)
    found = simulate(EMPS, p, given, fs=FS, controller=loop, drive=drive)

    def motion(time: float, x: np.ndarray, held: float | None) -> list[float]:
        r, rate, force = (
            float(np.interp(time, t, a)) for a in (given.reference, given.reference_rate, given.feedforward)
        )
        command = loop.kp * (r - x[0]) + loop.kv * (rate - x[2]) + force if held is None else held
        link = p["K"] * (x[0] - x[1]) + p["F_vmc"] * (x[2] - x[3])
        motor = (x[4] - p["F_vm"] * x[2] - link) / p["J_m"]
        return [x[2], x[3], motor, link / p["J_c"], (command - x[4]) / tau]

    x = np.zeros(5)
    for k in range(200):
        held = None
        if rate_hz:
            held = loop.kp * (given.reference[k] - x[0]) + loop.kv * (given.reference_rate[k] - x[2])
            held += given.feedforward[k]
        x = solve_ivp(
            motion, (t[k], t[k + 1]), x, method="DOP853", rtol=1e-12, atol=1e-13, args=(held,)
        ).y[:, -1]  # fmt: skip
        ours = [found.true[key][k + 1] for key in ("q_m", "q_c", "v_m", "v_c", "Gamma_m")]
        np.testing.assert_allclose(ours, x, rtol=1e-8, atol=1e-9)
    # the record reads the force, not the command
    np.testing.assert_array_equal(found.record.signals["Gamma_m"], found.true["Gamma_m"])
    assert np.abs(found.true["Gamma_m"] - found.true["command_Gamma_m"]).max() > 0.01


def test_a_sampled_loop_sticks_until_a_step_of_its_command_lets_go() -> None:
    p = {"M": 10.0, "Fv": 1.0, "Fc": 30.0, "offset": 2.0}
    loop = PositionVelocityController(kp=1000.0, kv=0.0)
    # the command steps from 31.9 to 32.1 N, over friction and offset, at 0.02 s
    r = np.where(np.arange(41) < 20, 0.0319, 0.0321)
    found = simulate(
        RIGID, p, Excitation(r, 0 * r, 0 * r, FS), fs=FS, controller=loop, drive=Drive(rate_hz=FS)
    )
    assert found.changes[0].time_s == pytest.approx(0.02, abs=1e-15)
    assert np.all(found.true["q_m"][:21] == 0.0)
    # constant force over one period: net 0.1 N
    assert found.true["q_m"][21] == pytest.approx(0.5 * 0.1 / 10.0 * 1e-6, rel=1e-3)


def test_fast_sampling_comes_close_to_a_continuous_controller() -> None:
    p = RIGID.parameter_sets["published_2019"]
    given = wave(64)
    continuous = simulate(RIGID, p, given, fs=FS, controller=LOOP).true["q_m"]
    errors = []
    for rate_hz in (4e3, 16e3):
        sampled = simulate(RIGID, p, given, fs=FS, controller=LOOP, drive=Drive(rate_hz=rate_hz)).true["q_m"]
        errors.append(np.abs(sampled - continuous).max())
    assert errors[0] < 2e-2 * np.abs(continuous).max()
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.15)


def test_a_cascade_feeds_no_rate_forward() -> None:
    loop = PositionVelocityController(LOOP.kp, LOOP.kv, rate_gain=0.0)
    given = wave()
    silent = Excitation(given.reference, 0.0 * given.reference_rate, given.feedforward, FS)
    for drive in (Drive(), Drive(rate_hz=FS)):
        a = simulate(RIGID, SLIDES, given, fs=FS, controller=loop, drive=drive).true
        b = simulate(RIGID, SLIDES, silent, fs=FS, controller=LOOP, drive=drive).true
        np.testing.assert_array_equal(a["q_m"], b["q_m"])


def test_a_bias_is_added_to_its_channel_only() -> None:
    p = EMPS.parameter_sets["light"]
    found = simulate(EMPS, p, "chirp", duration_s=0.5, bias={"a_c": -3.0})
    np.testing.assert_allclose(found.record.signals["a_c"], found.true["a_c"] - 3.0, rtol=1e-12)
    np.testing.assert_array_equal(found.record.signals["q_m"], found.true["q_m"])
    assert dict(found.settings.bias) == {"a_c": -3.0}
    with pytest.raises(DataError, match="bias: a_c: is inf; give a finite number"):
        simulate(EMPS, p, "chirp", bias={"a_c": np.inf})


def test_impossible_drives_are_explained() -> None:
    with pytest.raises(DataError) as caught:
        Drive(rate_hz=0.0, delay_s=-1.0, bandwidth_hz=0.0, limit=0.0, encoder_step=-1.0, velocity="fast")
    assert [problem.where for problem in caught.value.problems] == [
        "drive: rate_hz", "drive: delay_s", "drive: bandwidth_hz", "drive: limit", "drive: encoder_step",
        "drive: velocity",
    ]  # fmt: skip
