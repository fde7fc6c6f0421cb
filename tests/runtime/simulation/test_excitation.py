"""Chirps, trapezoids and the user's own arrays, piecewise linear at the internal rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.excitation import Excitation, chirp, excitation_from_record, trapezoid


def problems(make: Callable[..., Any], *arguments: Any, **options: Any) -> list[str]:
    with pytest.raises(DataError) as caught:
        make(*arguments, **options)
    return [str(problem) for problem in caught.value.problems]


def test_a_chirp_sweeps_its_band_linearly() -> None:
    wave = chirp(20.0, 200.0, 2.0, 5000.0, force=0.1, ramp_s=0.1, settle_s=0.1)
    t, force = wave.t, wave.feedforward
    assert t[-1] == pytest.approx(2.0 - 1.0 / 5000.0)
    assert np.all(force[(t <= 0.2) | (t >= 1.8)] == 0.0)
    crossings = t[:-1][force[:-1] * force[1:] < 0.0]
    # half the periods of the mean frequency; the local frequency follows from their distance
    assert len(crossings) == pytest.approx(2.0 * 110.0 * 1.6, abs=2)
    local_hz = 0.5 / np.diff(crossings)
    expected_hz = 20.0 + 180.0 * (0.5 * (crossings[1:] + crossings[:-1]) - 0.2) / 1.6
    np.testing.assert_allclose(local_hz, expected_hz, rtol=0.02)


def test_a_chirp_starts_and_stops_smoothly_on_a_constant_velocity() -> None:
    wave = chirp(20.0, 200.0, 2.0, 5000.0, force=0.1, velocity=50.0, ramp_s=0.1, settle_s=0.2)
    t, dt = wave.t, wave.t[1]
    assert np.all(wave.reference_rate[(t >= 0.1) & (t <= 1.89)] == 50.0)
    assert wave.reference_rate[0] == 0.0
    assert wave.reference_rate[-1] == 0.0
    assert np.abs(np.diff(wave.reference_rate)).max() / dt <= 50.0 * np.pi / 2.0 / 0.1 * 1.001
    envelope = np.abs(wave.feedforward)
    assert envelope.max() == pytest.approx(0.1, rel=1e-3)
    assert envelope[(t > 0.3) & (t < 0.31)].max() < 0.01
    assert np.abs(np.diff(wave.feedforward)).max() / dt < 0.1 * 2.0 * np.pi * 200.0


def test_a_chirp_may_sweep_the_velocity_and_downwards() -> None:
    wave = chirp(80.0, 10.0, 2.0, 5000.0, rate=3.0, velocity=5.0)
    assert np.all(wave.feedforward == 0.0)
    assert wave.reference_rate.max() == pytest.approx(8.0, rel=1e-3)
    middle = wave.reference_rate[(wave.t > 0.3) & (wave.t < 1.7)]
    assert middle.min() == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize(
    "wave",
    [chirp(5.0, 50.0, 1.0, 1000.0, rate=2.0, velocity=3.0), trapezoid([2.0, 1.0], 20.0, 3.0, 1000.0)],
    ids=["chirp", "trapezoid"],
)
def test_the_reference_is_the_exact_integral_of_its_rate(wave: Excitation) -> None:
    assert wave.reference[0] == 0.0
    mean = 0.5 * (wave.reference_rate[1:] + wave.reference_rate[:-1])
    np.testing.assert_allclose(np.diff(wave.reference) * wave.rate_hz, mean, atol=1e-9)


def test_a_trapezoid_goes_forward_dwells_goes_back_and_dwells_at_every_speed() -> None:
    wave = trapezoid([2.0, 1.0], 20.0, 1.6, 1000.0, cruise_s=0.1, dwell_s=0.05)
    rate = wave.reference_rate
    levels = rate[np.flatnonzero(np.diff(rate) == 0.0)]
    plateaus = [levels[0], *levels[1:][np.abs(np.diff(levels)) > 0.5]]
    assert plateaus == [2.0, 0.0, -2.0, 0.0, 1.0, 0.0, -1.0, 0.0, 2.0, 0.0]
    assert np.abs(np.diff(rate)).max() * wave.rate_hz == pytest.approx(20.0)
    # 0.1 s up, 0.1 s cruise, 0.1 s down: twice the speed times 0.1 s
    assert wave.reference.max() == pytest.approx(0.4)
    back = round(0.7 * wave.rate_hz)
    assert wave.reference[back] == pytest.approx(0.0, abs=1e-12)
    rests = np.flatnonzero(rate[: back + 1] == 0.0)
    assert len(rests) == pytest.approx(2 * 0.05 * wave.rate_hz, abs=3)


def test_samples_fall_on_internal_steps() -> None:
    for wave in (
        chirp(5.0, 50.0, 1.0, 1000.0, oversample=3),
        trapezoid([1.0], 9.0, 1.0, 1000.0, oversample=3),
    ):
        assert wave.rate_hz == 3000.0
        assert wave.t.size == 999 * 3 + 1


def test_wrong_levels_are_named() -> None:
    assert problems(chirp, 0.0, 600.0, 1.0, 1000.0) == [
        "chirp: band: is 0 Hz to 600 Hz; give two positive frequencies",
        "chirp: band: is 0 Hz to 600 Hz; stay below 500 Hz, half of fs, or raise fs",
    ]
    assert problems(chirp, 10.0, 100.0, 0.3, 1000.0) == [
        "duration_s: leaves no time between 0.2 s and 0.1 s; make it longer"
    ]
    assert problems(trapezoid, [], -1.0, 1.0, 1000.0, cruise_s=-1.0, dwell_s=0.03) == [
        "speeds: must be one or more positive numbers; give them",
        "acceleration: must be positive; give it in rad/s^2 or m/s^2",
        "cruise_s: is negative; give a time in s",
        "dwell_s: is 0.03 s, too short to stick; give at least 0.04 s",
    ]
    assert problems(trapezoid, [1.0], 1.0, 1e-4, 1000.0, oversample=0) == [
        "duration_s: is 0.0001 s; give two samples or more",
        "oversample: is 0; give a whole number, 1 or more",
    ]
    assert problems(trapezoid, [1.0], 1.0, float("nan"), 1000.0) == [
        "duration_s: is nan s; give two samples or more"
    ]
    assert problems(trapezoid, [1.0], 1.0, 1.0, -1000.0)[0] == (
        "fs: is -1000.0; give a frequency from 1e-09 to 1e+09 Hz, finite and positive"
    )


def test_arrays_are_checked_and_copied() -> None:
    given = np.zeros(9)
    wave = Excitation(given, given, given, 100.0, "mine")
    given[:] = 1.0
    assert np.all(wave.reference == 0.0)
    assert not wave.feedforward.flags.writeable
    np.testing.assert_allclose(wave.t, np.arange(9) / 100.0)
    found = problems(replace, wave, reference=np.full(9, np.nan), feedforward=np.zeros(8))
    assert [problem.split(":")[0] for problem in found] == ["mine", "mine"]
    assert "channel reference: holds no number" in found[0]
    assert "differ in length" in found[1]


def test_the_users_own_arrays_are_joined_by_lines() -> None:
    t = np.arange(50) / 100.0
    record = Record({"reference": np.sin(t), "feedforward": t**2}, 100.0, "mine")
    wave = excitation_from_record(record, oversample=4)
    assert (wave.name, wave.rate_hz, wave.t.size) == ("mine", 400.0, 197)
    np.testing.assert_allclose(wave.reference[::4], np.sin(t), rtol=1e-15)
    np.testing.assert_allclose(wave.feedforward[2::4], 0.5 * (t[1:] ** 2 + t[:-1] ** 2), rtol=1e-12)
    np.testing.assert_allclose(wave.reference_rate[::4], np.cos(t), atol=0.01)
    own_rate = Record({**record.signals, "reference_rate": 0.0 * t + 7.0}, 100.0)
    assert np.all(excitation_from_record(own_rate).reference_rate == 7.0)


def test_a_force_alone_is_an_excitation() -> None:
    wave = excitation_from_record(Record({"feedforward": np.ones(5)}, 100.0))
    assert np.all(wave.reference == 0.0)
    assert np.all(wave.reference_rate == 0.0)
    assert np.all(wave.feedforward == 1.0)


def test_a_record_without_excitation_is_refused() -> None:
    record = Record({"q_m": np.ones(5)}, 100.0, "run1")
    assert problems(excitation_from_record, record) == [
        "run1: has no channel reference or feedforward, only q_m; name one of them, or map a column to it"
    ]
    assert problems(excitation_from_record, Record({"reference": np.ones(5)}, 100.0), 0) == [
        "oversample: is 0; give a whole number, 1 or more"
    ]
