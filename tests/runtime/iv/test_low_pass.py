"""Sensors behind a low-pass of two poles (undone exactly, found in place of a delay), or a high-pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, tf2sos

from generated import emps300_qm_ac
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.low_pass import (
    high_pass,
    lag_for_delay,
    low_pass,
    noise_passed,
    two_poles,
    undone_high_pass,
    without_starts,
)
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import RAMPS, SMALL, TRUTH

FS, FINE = 5000.0, 8
QM_AC = model_from_module(emps300_qm_ac)
PARAMETERS = {name: TRUTH[name] for name in QM_AC.parameters if name in TRUTH}


@given(
    late=st.floats(0.05, 8.0),
    bend=st.floats(0.25, 1.5),
    frequency=st.floats(0.0, 0.1),
    phase=st.floats(0.0, 6.3),
)
def test_two_poles_are_made_and_undone_below_a_tenth_of_the_sampling_frequency(
    late: float, bend: float, frequency: float, phase: float
) -> None:
    """`late` in samples; the delay is part of the low-pass."""
    n, middle = 1200, slice(500, 700)
    record = Record({"q": np.zeros(n)}, FS, "run")
    s = 2.0j * np.pi * frequency * late
    true = np.exp(1j * (2.0 * np.pi * frequency * np.arange(n) + phase))
    behind = true / (1.0 + s + bend * s**2)
    effect = two_poles("q", bend)
    edits = [effect.edit("q", sign * late / FS, record) for sign in (1.0, -1.0) if effect.edit]
    undone, made = edits[0].whole(behind.real), edits[1].whole(true.real)
    np.testing.assert_allclose(undone[middle], true.real[middle], atol=1e-5)
    np.testing.assert_allclose(made[middle], behind.real[middle], atol=1e-5)
    passed = noise_passed(effect, late / FS, np.array([frequency * FS]), FS)
    assert passed[0] == pytest.approx(float(np.abs(1.0 + s + bend * s**2)) ** 2)


def test_a_gain_that_is_set_right_makes_as_much_less_of_noise() -> None:
    effect = next(one for one in effects_of(SMALL, ("m", "c"), RAMPS) if one.name == "gain of q_c")
    np.testing.assert_allclose(noise_passed(effect, 0.25, np.array([1.0, 100.0]), FS), 0.64)


@pytest.mark.parametrize("force", [True, False])
def test_a_delay_that_is_one_of_a_lag_has_a_size_of_one(force: bool) -> None:
    record = Record({"q": np.sin(2.0 * np.pi * 30.0 * np.arange(2000) / FS)}, FS, "run")
    simulated = Simulated(None, record, {}, 0)  # type: ignore[arg-type]
    bent = low_pass("q", force).changes(simulated)["q"]
    found = lag_for_delay("q", -3e-4, force).changes(simulated)["q"]
    np.testing.assert_allclose(found, 0.5 * 3e-4**2 * bent)


@pytest.mark.parametrize("size", [4e-4, -4e-4])
def test_what_more_delay_and_another_damping_add_is_the_change_of_what_undoes_them(size: float) -> None:
    n, middle = 4000, slice(1000, 3000)
    record = Record({"q": np.sin(2.0 * np.pi * 150.0 * np.arange(n) / FS)}, FS, "run")
    simulated = Simulated(None, record, {}, 0)  # type: ignore[arg-type]
    effect = two_poles("q", 0.4, abs(size))
    back = effect.edit("q", -size, record).whole(record.signals["q"])  # type: ignore[misc]

    def undone(by: float, bend: float) -> np.ndarray:
        edit = two_poles("q", bend).edit
        assert edit is not None
        return edit("q", size + by, record).whole(back)

    step = 0.01 * abs(size)
    (shape,) = effect.shape(1)
    by_delay = (undone(-step, 0.4) - undone(step, 0.4)) / (2.0 * step)
    # of the coefficient of s^2, in s^2
    by_bend = np.sign(size) * (undone(0.0, 0.39) - undone(0.0, 0.41)) / (0.02 * size**2)
    for found, expected in ((by_delay, effect.added(simulated, size)), (by_bend, shape.changes(simulated))):
        scale = float(np.max(np.abs(expected["q"][middle])))
        np.testing.assert_allclose(found[middle], expected["q"][middle], atol=0.02 * scale)


def test_the_damping_moves_within_what_sensors_have() -> None:
    effect = two_poles("q", 0.5)
    assert effect.moved is not None
    assert "damping ratio of 0.65" in effect.moved(1e-3, [0.1e-6]).said(1e-3)
    assert "damping ratio of 0.79" in effect.moved(-1e-3, [0.1e-6]).said(-1e-3)
    assert "damping ratio of 0.58" in effect.moved(1e-3, [1.0]).said(1e-3)
    assert "damping ratio of 0.71 (late by 1e+03 us)" in effect.moved(0.0, [1.0]).said(1e-3)


def of_sensor(read: np.ndarray, true: np.ndarray, index: int = 0) -> Simulated:
    """What an accelerometer reads, and what it would read without a high-pass."""
    records = (Record({"a": one}, FS, "run") for one in (true, read))
    return Simulated(None, next(records), {}, index, measured=next(records))  # type: ignore[arg-type]


def high_passed(true: np.ndarray, corner: float, begun: float) -> np.ndarray:
    """A signal behind s / (s + corner), `corner` in rad/s, whose integral begins with `begun`."""
    half = 0.5 * corner / FS
    passed = sosfilt(tf2sos([0.5 / FS, 0.5 / FS], [1.0 + half, half - 1.0]), true)
    return true - corner * (passed + begun * np.exp(-corner * np.arange(true.size) / FS))


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_what_a_high_pass_loses_is_known_from_the_reading(off: float) -> None:
    """The motion is simulated `off` by that share."""
    n, corner, begun = 20000, 2.0, 0.3
    t = np.arange(n) / FS
    true = 20.0 * np.sin(2.0 * np.pi * 1.5 * t**2)
    read = high_passed(true, corner, begun)
    effect = high_pass("a").moved(corner, [-corner * begun])  # type: ignore[misc]
    lost = corner * effect.added(of_sensor(read, (1.0 + off) * true), corner)["a"]
    # what is lost of what begins dies away
    later = slice(int(3.0 * FS), n)
    np.testing.assert_allclose(lost[later], (read - true)[later], atol=0.02 + 4.0 * off)
    other = without_starts(effect, corner)
    anew = corner * other.added(of_sensor(read, true), corner)["a"]
    edit = undone_high_pass("a").edit
    assert edit is not None
    undone = edit("a", corner, Record({"a": read}, FS, "run")).whole(read)
    # to a straight line: the mean of the reading is left out
    line = np.polyval(np.polyfit(t, undone - true, 1), t)
    np.testing.assert_allclose(undone, true + line, atol=0.02)
    (begins,) = other.elsewhere(1)
    dies = begins.changes(of_sensor(read, true))["a"]
    np.testing.assert_allclose(anew - corner * begun * dies, lost, atol=0.02 + 4.0 * off)
    assert not begins.changes(of_sensor(read, true, index=1))


def filtered_records(sos: np.ndarray, seed: int) -> list[Record]:
    """A chirp and a trapezoid; the accelerometer is read behind a filter in second-order sections."""
    found, noise = list[Record](), np.random.default_rng(seed)
    for kind in ("chirp", "trapezoid"):
        clean = simulate(QM_AC, PARAMETERS, kind, fs=FINE * FS, duration_s=2.0).record
        signals = {**clean.signals, "a_c": sosfilt(sos, clean.signals["a_c"])}
        sizes = {"q_m": 2e-5, "a_c": 1.0, "Gamma_m": 1e-5}
        read = {
            key: one[::FINE] + sizes[key] * noise.standard_normal(one[::FINE].size)
            for key, one in signals.items()
        }
        found.append(replace(clean, signals=read, fs=FS, name=kind))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("corner_hz", [300.0, 600.0])
def test_an_accelerometer_behind_a_low_pass_of_second_order_is_named_and_set_right(corner_hz: float) -> None:
    sos = butter(2, corner_hz, fs=FINE * FS, output="sos")
    estimate = identify(QM_AC, filtered_records(sos, seed=3))
    told = [one.what for one in estimate.checks.advice]
    assert any("a_c is read through a low-pass of its own, of second order" in what for what in told)
    assert not any("hold what that moves" in what for what in told)
    for name, value in PARAMETERS.items():
        assert abs(estimate.params[name] - value) < 3.0 * estimate.bse[name], name
    assert estimate.bse["K"] < 3e-3 * TRUTH["K"]


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.0, 0.75])
def test_an_accelerometer_behind_a_high_pass_is_named_and_its_intervals_hold(share: float) -> None:
    """Slow motion is lost: a load's inertia, stiffness and damping were refused, and friction was off."""
    sos = butter(1, 0.5, "highpass", fs=FINE * FS, output="sos")
    records = filtered_records(sos, seed=3)
    estimate = identify(QM_AC, [one.part(0, round(share * one.n), one.name) for one in records])
    told = [one.what for one in estimate.checks.advice]
    assert any("a_c is read behind a high-pass (AC coupling) (corner about 0.5 Hz)" in what for what in told)
    for name, value in PARAMETERS.items():
        assert abs(estimate.params[name] - value) < 3.0 * estimate.bse[name], name
    assert estimate.bse["J_c"] < 5e-3 * TRUTH["J_c"]
