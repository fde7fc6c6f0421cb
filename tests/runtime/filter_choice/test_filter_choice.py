from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import (
    choose_filter,
    distortion_bound_hz,
)
from modelgen.runtime.filter_choice.motion_band import record_band
from modelgen.runtime.filter_choice.record_length import decimation_for
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record

CHAIN, RIGID = model_from_module(emps300_qm_qc), model_from_module(emps_rigid_qm)
FS = 5000.0


def tones(motor_hz: float, load_hz: float, force_hz: float, n: int = 20000, name: str = "tones") -> Record:
    """A record of the chain in which every channel vibrates at one frequency, on a constant velocity."""
    t = np.arange(n) / FS
    signals = {
        "q_m": 30.0 * t + 1e-3 * np.sin(2.0 * np.pi * motor_hz * t),
        "q_c": 30.0 * t + 1e-3 * np.sin(2.0 * np.pi * load_hz * t),
        "Gamma_m": np.sin(2.0 * np.pi * force_hz * t),
    }
    return Record(signals, FS, name)


def test_the_common_dynamics_are_those_of_the_slowest_body() -> None:
    band = record_band(CHAIN, tones(150.0, 90.0, 200.0))
    assert band.force_hz == pytest.approx(200.0, abs=1.0)
    assert band.dynamics_hz == pytest.approx(90.0, abs=1.0)
    assert band.body == "c"


def test_what_lies_above_the_force_does_not_count() -> None:
    t = np.arange(20000) / FS
    signals = dict(tones(100.0, 100.0, 120.0).signals)
    signals["q_c"] = signals["q_c"] + 1e-3 * np.sin(2.0 * np.pi * 900.0 * t)
    assert record_band(CHAIN, Record(signals, FS)).dynamics_hz == pytest.approx(100.0, abs=1.0)


def test_noise_does_not_change_the_choice() -> None:
    record, rng = tones(150.0, 90.0, 200.0), np.random.default_rng(0)
    noisy = Record({k: v + 1e-4 * rng.standard_normal(v.size) for k, v in record.signals.items()}, FS)
    assert choose_filter(CHAIN, [noisy]).cutoff_hz == pytest.approx(
        choose_filter(CHAIN, [record]).cutoff_hz, rel=0.01
    )


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_filter_takes_five_percent_off_the_dynamics(order: int) -> None:
    t = np.arange(20000) / FS
    wave = np.sin(2.0 * np.pi * 90.0 * t)
    smooth = zero_phase(wave, order, distortion_bound_hz(90.0, order), FS)
    assert np.abs(smooth[5000:15000]).max() == pytest.approx(0.95, abs=2e-3)


def test_the_whole_choice_on_one_record() -> None:
    choice = choose_filter(CHAIN, [tones(150.0, 90.0, 200.0)])
    assert choice.filter_order == 4  # the rows' order 2, and 2
    assert choice.cutoff_hz == pytest.approx(90.0 * 19.0 ** (1.0 / 8.0), rel=0.01)
    assert choice.direction_cutoff_hz == choice.dynamics_hz
    assert choice.decimation == (15,)
    assert choice.sampling_ratio == pytest.approx(5000.0 / 90.0, rel=0.01)
    assert choice.notes == ()


def test_one_cutoff_serves_all_records_and_each_has_its_decimation() -> None:
    fast, slow = tones(150.0, 90.0, 200.0, name="fast"), tones(20.0, 15.0, 25.0)
    slow = Record({key: samples[::2] for key, samples in slow.signals.items()}, FS / 2.0, "slow")
    choice = choose_filter(CHAIN, [slow, fast])
    assert choice.cutoff_hz == pytest.approx(choose_filter(CHAIN, [fast]).cutoff_hz)
    assert choice.decimation == (7, 15)
    assert [band.record for band in choice.bands] == ["slow", "fast"]


@pytest.mark.parametrize(
    ("fs", "cutoff_hz", "factor"), [(1000.0, 43.0, 9), (1000.0, 40.0, 10), (100.0, 90.0, 1)]
)
def test_decimation_leaves_a_quarter_of_room_above_the_cutoff(
    fs: float, cutoff_hz: float, factor: int
) -> None:
    assert decimation_for(fs, cutoff_hz) == factor


def test_slow_sampling_is_noted_and_the_cutoff_stays_below_it() -> None:
    record = tones(1700.0, 1700.0, 1800.0)
    choice = choose_filter(CHAIN, [record])
    assert choice.cutoff_hz == 0.4 * FS
    assert any("more than sampling allows" in note for note in choice.notes)
    assert any("sampled only 2.9 times faster" in note for note in choice.notes)


def test_what_is_given_is_taken_and_said() -> None:
    choice = choose_filter(
        CHAIN,
        [tones(150.0, 90.0, 200.0)],
        cutoff_hz=300.0,
        filter_order=6,
        decimation=3,
        direction_cutoff_hz=80.0,
    )
    assert (choice.cutoff_hz, choice.filter_order, choice.direction_cutoff_hz) == (300.0, 6, 80.0)
    assert choice.decimation == (3,)
    said = " ".join(choice.sentences)
    assert "Cut-off 300 Hz as given (order 6" in said
    assert "below 80 Hz as given" in said
    assert "every 3rd sample of 5000 Hz (as given)" in said


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"cutoff_hz": 2500.0}, "cutoff_hz"),
        ({"cutoff_hz": -1.0}, "cutoff_hz"),
        ({"cutoff_hz": float("nan")}, "cutoff_hz"),
        ({"direction_cutoff_hz": 0.0}, "direction_cutoff_hz"),
        ({"filter_order": 0}, "filter_order"),
        ({"filter_order": 21}, "filter_order"),
        ({"filter_order": True}, "filter_order"),
        ({"decimation": 0}, "decimation"),
        ({"decimation": 2.0}, "decimation"),
    ],
)
def test_options_out_of_range_are_named(options: dict[str, Any], where: str) -> None:
    with pytest.raises(DataError) as raised:
        choose_filter(CHAIN, [tones(150.0, 90.0, 200.0)], **options)
    assert raised.value.problems[0].where == where


def test_nothing_moves() -> None:
    still = Record({"q_m": np.zeros(1000), "F": np.ones(1000)}, FS, "still")
    with pytest.raises(DataError, match="still: no sensor of a body moves"):
        choose_filter(RIGID, [still])
    assert choose_filter(RIGID, [still], cutoff_hz=50.0).dynamics_hz is None


def test_a_handful_of_samples_is_too_short() -> None:
    with pytest.raises(DataError, match="has 30 samples"):
        choose_filter(RIGID, [Record({"q_m": np.arange(30.0), "F": np.arange(30.0)}, FS)])
