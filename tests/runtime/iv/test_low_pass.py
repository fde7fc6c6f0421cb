"""A sensor behind a low-pass of two poles: undone exactly, and found in place of a delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt

from generated import emps300_qm_ac
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.low_pass import lag_for_delay, low_pass, noise_passed, two_poles
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import TRUTH

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


def low_passed_records(corner_hz: float, seed: int) -> list[Record]:
    """A chirp and a trapezoid; the accelerometer is read behind Butterworth's filter of second order."""
    found, noise = list[Record](), np.random.default_rng(seed)
    for kind in ("chirp", "trapezoid"):
        clean = simulate(QM_AC, PARAMETERS, kind, fs=FINE * FS, duration_s=2.0).record
        sos = butter(2, corner_hz, fs=FINE * FS, output="sos")
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
    estimate = identify(QM_AC, low_passed_records(corner_hz, seed=3))
    told = [one.what for one in estimate.checks.advice]
    assert any("a_c is read through a low-pass of its own, of second order" in what for what in told)
    assert not any("hold what that moves" in what for what in told)
    for name, value in PARAMETERS.items():
        assert abs(estimate.params[name] - value) < 3.0 * estimate.bse[name], name
    assert estimate.bse["K"] < 3e-3 * TRUTH["K"]
