"""Readings that begin again after a turn, or that are repeated, are found and set right; others are left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from modelgen.runtime.filters.readings import between_readings, modulus, repeats, unwrapped

FloatArray = npt.NDArray[np.float64]
TURN = 2.0 * np.pi
T = np.arange(4000) / 1000.0
NOISE = 1e-4 * np.random.default_rng(4).standard_normal(T.size)
ANGLE = 9.0 * np.sin(2.0 * np.pi * 0.4 * T) + np.sin(2.0 * np.pi * 3.0 * T) + NOISE


@pytest.mark.parametrize(
    ("wrapped", "size"),
    [
        (ANGLE % TURN, TURN),
        ((ANGLE + np.pi) % TURN - np.pi, TURN),
        (np.round(ANGLE / TURN * 4096.0) % 4096.0, 4096.0),
        (np.degrees(ANGLE) % 360.0, 360.0),
    ],
    ids=["0 to turn", "half turns", "counts", "degrees"],
)
def test_turns_are_found_and_added(wrapped: FloatArray, size: float) -> None:
    assert modulus(wrapped) == size
    straight = unwrapped(wrapped, size) * TURN / size
    np.testing.assert_allclose(straight - straight[0], ANGLE - ANGLE[0], atol=TURN / 4096.0)


def test_a_modulus_that_is_no_turn_is_measured() -> None:
    assert modulus(ANGLE % 3.3) == pytest.approx(3.3, rel=1e-3)


@pytest.mark.parametrize("bits", [16, 18])
def test_a_counter_with_a_factor_begins_again_after_its_counts(bits: int) -> None:
    factor = TURN / 4096.0
    there_and_back = np.round(120_000.0 * np.sin(2.0 * np.pi * 0.4 * T) + 2e4 * NOISE) + 20_000.0
    counts = (there_and_back + 2.0 ** (bits - 1)) % 2.0**bits - 2.0 ** (bits - 1)
    assert modulus(counts * factor) == pytest.approx(2.0**bits * factor, rel=1e-9)
    once = (np.round(30_000.0 * T + 2e4 * NOISE) + 20_000.0) % 2.0**bits  # at 18 bits it never begins again
    assert modulus(once[:3000] * factor) == (
        pytest.approx(2.0**16 * factor, rel=1e-9) if bits == 16 else None
    )


def _dropped_out(samples: FloatArray) -> FloatArray:
    return np.where(np.abs(np.arange(samples.size) - 2000) < 3, 0.0, samples)


@pytest.mark.parametrize(
    "change",
    [
        lambda x: x,
        lambda x: np.where(np.arange(x.size) == 900, 0.0, x + 20.0),
        lambda x: _dropped_out(x + 20.0),
        lambda x: np.sign(x),
        lambda x: np.where(T < 2.0, x, x + 50.0),
        lambda x: np.random.default_rng(1).uniform(0.0, TURN, x.size),
        lambda x: np.zeros(x.size),
    ],
    ids=["good", "one wrong reading", "lost for a while", "square wave", "moved unseen", "noise", "rest"],
)
def test_other_jumps_are_no_turns(change: Callable[[FloatArray], FloatArray]) -> None:
    assert modulus(change(ANGLE)) is None


@pytest.mark.parametrize(("every", "first"), [(2, 0), (4, 0), (4, 3), (10, 7)])
def test_repeated_readings_are_found_and_interpolated(every: int, first: int) -> None:
    start = (every - first) % every
    held, fresh = ANGLE[np.arange(T.size) // every * every][start:], ANGLE[start:]
    assert repeats(held) == (every, first)
    between = between_readings(held, every, first)
    inside = slice(3 * every, -3 * every)
    assert np.abs(held - fresh)[inside].max() > 0.01
    np.testing.assert_allclose(between[inside], fresh[inside], atol=2e-3)


@pytest.mark.parametrize(
    ("every", "first"), [(2.5, 0.3), (1.6, 0.77), (1.25, 0.77), (2.7183, 0.3), (7.77, 0.0)]
)
def test_readings_that_come_between_samples_are_found_and_interpolated(every: float, first: float) -> None:
    came = np.floor((np.arange(T.size) - first) / every) * every + first
    held = np.round(np.interp(came, np.arange(T.size), ANGLE) * 1e6) / 1e6
    found = repeats(held)
    assert found is not None and found[0] == pytest.approx(every, abs=2e-4)
    between = between_readings(held, *found)
    inside = slice(20, -20)
    # but for when they came, which only the model can tell
    late = np.gradient(ANGLE)[inside]
    wrong = (between - ANGLE)[inside]
    wrong -= late * (late @ wrong) / (late @ late)
    assert np.abs(held - ANGLE)[inside].max() > 0.01
    assert np.abs(wrong).max() < 0.02 * np.abs(held - ANGLE)[inside].max()


@pytest.mark.parametrize("share", [0.02, 0.2, 0.6])
def test_readings_that_are_lost_at_random_have_no_period(share: float) -> None:
    held = ANGLE.copy()
    for place in np.flatnonzero(np.random.default_rng(1).random(T.size - 1) < share) + 1:
        held[place] = held[place - 1]
    assert repeats(held) is None


@pytest.mark.parametrize(
    "samples",
    [
        ANGLE,
        np.round(ANGLE / 0.05) * 0.05,  # a coarse encoder
        np.round(np.linspace(0.0, 1.0, T.size) * 1000.0),  # a slow one that counts in step with the clock
        np.sign(np.sin(2.0 * np.pi * 12.5 * T)),  # a command of two levels
        np.zeros(T.size),
        ANGLE[np.maximum(np.arange(T.size) - T.size // 3, 0)],  # at every sample a new one, after a rest
    ],
    ids=["new ones", "coarse", "slow", "two levels", "rest", "rest at first"],
)
def test_readings_that_repeat_by_themselves_are_left(samples: FloatArray) -> None:
    assert repeats(samples) is None
