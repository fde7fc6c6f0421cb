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
    "samples",
    [
        ANGLE,
        np.round(ANGLE / 0.05) * 0.05,  # a coarse encoder
        np.round(np.linspace(0.0, 1.0, T.size) * 1000.0),  # a slow one that counts in step with the clock
        np.sign(np.sin(2.0 * np.pi * 12.5 * T)),  # a command of two levels
        np.zeros(T.size),
    ],
    ids=["new ones", "coarse", "slow", "two levels", "rest"],
)
def test_readings_that_repeat_by_themselves_are_left(samples: FloatArray) -> None:
    assert repeats(samples) is None
