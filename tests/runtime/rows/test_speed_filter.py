"""Speeds whose signs are directions: noise turns nothing, and faster motion does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
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


def speed(settings: FilterChoice, position: FloatArray) -> FloatArray:
    readings = position + NOISE * np.random.default_rng(3).standard_normal(N)
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
    slow = np.sin(SLOW * T) / SLOW
    narrow, found = (speed(one, slow) for one in (replace(choice(NOISE), turning_noise=()), choice(NOISE)))
    assert np.allclose(found, narrow, rtol=0.0, atol=1e-9)


def test_a_cut_off_that_is_given_is_the_only_one() -> None:
    rng = np.random.default_rng(4)
    slow = np.sin(SLOW * T) / SLOW + NOISE * rng.standard_normal(N)
    record = Record({"q_m": slow, "F": rng.standard_normal(N)}, FS, "one")
    free = choose_filter(RIGID, [record], cutoff_hz=100.0)
    ((channel, density),) = free.turning_noise
    assert channel == "q_m"
    assert density == pytest.approx(2.0 * NOISE**2 / FS, rel=0.2)
    assert any(one.endswith("velocities below 100 Hz count.") for one in free.sentences)
    given = choose_filter(RIGID, [record], cutoff_hz=100.0, direction_cutoff_hz=20.0)
    assert given.turning_noise == ()
    assert not any(one.endswith("count.") for one in given.sentences)
