"""Speeds whose signs are directions: noise turns nothing, and faster motion does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filter_choice.turning_band import turning_noise
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from tests.runtime.rigid_motion import RIGID

FS, N, NOISE = 1000.0, 6000, 1e-5
T = np.arange(N) / FS
# a slow motion, and beside it one of 70 Hz that is twice as fast, in the last second alone
SLOW, AT = 2.0 * np.pi * 0.5, 2.0 * np.pi * 70.0
SPEED = np.cos(SLOW * T) + np.where(T > 5.0, 2.0 * np.cos(AT * T), 0.0)
POSITION = np.sin(SLOW * T) / SLOW + np.where(T > 5.0, 2.0 * np.sin(AT * T) / AT, 0.0)


def choice(noise: float) -> FilterChoice:
    density = 2.0 * noise**2 / FS
    return FilterChoice(4, 100.0, 20.0, (5,), 20.0, None, (), (), (), turning_noise=(("q_m", density),))


def speed(settings: FilterChoice, position: FloatArray, noise: float = NOISE) -> FloatArray:
    readings = position + noise * np.random.default_rng(3).standard_normal(N)
    rows = unmasked_rows(RIGID, Record({"q_m": readings, "F": np.zeros(N)}, FS), settings, 1)
    (key,) = rows.plan.directions
    return np.concatenate(list(rows.over_chunks(lambda one: one.direction(key, one.start, one.stop))))


def test_motion_beyond_the_low_pass_turns_where_it_is() -> None:
    narrow, found = (
        speed(one, POSITION) for one in (replace(choice(NOISE), turning_noise=()), choice(NOISE))
    )
    start = int(N - len(found)) // 2
    true = SPEED[start : start + len(found)]
    late = np.arange(start, start + len(found)) > 5100
    clear = np.abs(true) > 0.3
    assert np.mean(np.sign(narrow[late]) == np.sign(true[late])) < 0.8
    assert np.all(np.sign(found[late & clear]) == np.sign(true[late & clear]))


def test_noise_beyond_the_low_pass_turns_nothing() -> None:
    slow, loud = np.sin(SLOW * T) / SLOW, 100.0 * NOISE
    known = choice(loud)
    narrow, found, wide, silent = (
        np.sign(speed(one, slow, loud))
        for one in (
            replace(known, turning_noise=()),
            known,
            replace(known, direction_cutoff_hz=100.0),
            choice(0.0),
        )
    )
    assert np.array_equal(found, narrow)
    assert np.sum(np.diff(wide) != 0.0) > 2 * np.sum(np.diff(found) != 0.0)
    # a record knows its own noise, whatever that of others is
    assert np.array_equal(silent, found)


def test_readings_that_turn_faster_than_a_low_pass_sees_are_found() -> None:
    rng = np.random.default_rng(4)

    def record(position: FloatArray) -> Record:
        readings = position + NOISE * rng.standard_normal(N)
        return Record({"q_m": readings, "F": rng.standard_normal(N)}, FS, "one")

    fast, calm = record(POSITION), record(np.sin(SLOW * T) / SLOW)
    ((channel, density),) = turning_noise(RIGID, [calm, fast], 45.0)
    assert channel == "q_m"
    assert density == pytest.approx(2.0 * NOISE**2 / FS, rel=0.2)
    assert turning_noise(RIGID, [fast], 90.0) == ()
    assert turning_noise(RIGID, [calm], 45.0) == ()


def test_a_cut_off_that_is_given_is_the_only_one() -> None:
    rng = np.random.default_rng(4)
    # a chirp up to 90 Hz, of which a window leaves nothing, beside a slow motion
    phase = 2.0 * np.pi * (2.0 + 0.5 * 88.0 / T[-1] * T) * T
    readings = np.cumsum(np.cos(SLOW * T) + 1.5 * np.cos(phase)) / FS + NOISE * rng.standard_normal(N)
    record = Record({"q_m": readings, "F": np.gradient(np.cos(phase))}, FS, "one")
    free = choose_filter(RIGID, [record])
    assert free.direction_cutoff_hz < 90.0
    assert [channel for channel, _ in free.turning_noise] == ["q_m"]
    assert any(one.endswith("Hz count.") for one in free.sentences)
    given = choose_filter(RIGID, [record], direction_cutoff_hz=20.0)
    assert given.turning_noise == ()
    assert not any(one.endswith("count.") for one in given.sentences)
