"""Speeds whose signs are directions: noise turns nothing, and faster motion does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filter_choice.turning_band import FasterTurns, faster_turns, seen_to_hz
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from tests.runtime.rigid_motion import RIGID

FS, N, NOISE, BAND = 1000.0, 6000, 1e-5, 100.0
T = np.arange(N) / FS
# a slow motion, and beside it one of 70 Hz that is twice as fast, in the last second alone
SLOW, AT = 2.0 * np.pi * 0.5, 2.0 * np.pi * 70.0
SPEED = np.cos(SLOW * T) + np.where(T > 5.0, 2.0 * np.cos(AT * T), 0.0)
POSITION = np.sin(SLOW * T) / SLOW + np.where(T > 5.0, 2.0 * np.sin(AT * T) / AT, 0.0)


def choice(noise: float) -> FilterChoice:
    density = 2.0 * noise**2 / FS
    faster = (FasterTurns("q_m", density, BAND),)
    return FilterChoice(4, 100.0, 20.0, (5,), 20.0, None, (), (), (), faster=faster)


def speed(settings: FilterChoice, position: FloatArray, noise: float = NOISE) -> FloatArray:
    readings = position + noise * np.random.default_rng(3).standard_normal(N)
    rows = unmasked_rows(RIGID, Record({"q_m": readings, "F": np.zeros(N)}, FS), settings, 1)
    (key,) = rows.plan.directions
    return np.concatenate(list(rows.over_chunks(lambda one: one.direction(key, one.start, one.stop))))


def test_motion_beyond_the_low_pass_turns_where_it_is() -> None:
    narrow, found = (speed(one, POSITION) for one in (replace(choice(NOISE), faster=()), choice(NOISE)))
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
            replace(known, faster=()),
            known,
            replace(known, direction_cutoff_hz=BAND),
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
    (found,) = faster_turns(RIGID, [calm, fast], 45.0, 60.0)
    assert found.channel == "q_m"
    assert found.noise == pytest.approx(2.0 * NOISE**2 / FS, rel=0.2)
    # the slow one is the first in which noise hides a reversal
    assert found.band_hz == max(seen_to_hz(calm, "q_m", 1, 60.0), 60.0) < seen_to_hz(fast, "q_m", 1, 60.0)
    assert faster_turns(RIGID, [fast], 90.0, 120.0) == ()
    assert faster_turns(RIGID, [calm], 45.0, 60.0) == ()


def test_a_cut_off_that_is_given_is_the_only_one() -> None:
    rng = np.random.default_rng(4)
    # a chirp up to 90 Hz, of which a window leaves nothing, beside a slow motion
    phase = 2.0 * np.pi * (2.0 + 0.5 * 88.0 / T[-1] * T) * T
    readings = np.cumsum(np.cos(SLOW * T) + 1.5 * np.cos(phase)) / FS + NOISE * rng.standard_normal(N)
    record = Record({"q_m": readings, "F": np.gradient(np.cos(phase))}, FS, "one")
    free = choose_filter(RIGID, [record])
    assert free.direction_cutoff_hz < 90.0
    assert [one.channel for one in free.faster] == ["q_m"]
    assert free.faster[0].band_hz >= free.cutoff_hz
    assert any(one.endswith("Hz counts.") for one in free.sentences)
    given = choose_filter(RIGID, [record], direction_cutoff_hz=20.0)
    assert given.faster == ()
    assert not any(one.endswith("counts.") for one in given.sentences)
