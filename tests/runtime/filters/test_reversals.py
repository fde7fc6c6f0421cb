from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.runtime.filters.reversals import reversals, standstill_threshold, standstills, turns, widen


def velocity_with_a_rest() -> np.ndarray:
    """Forward 1 for 100 samples, at rest for 40, backward for 100, a touch of zero, backward again."""
    return np.concatenate([np.ones(100), np.zeros(40), -np.ones(100), [0.0], -np.ones(60)])


def test_standstills_are_rests_of_a_certain_length() -> None:
    velocity = velocity_with_a_rest()
    assert np.flatnonzero(standstills(velocity, 20)).tolist() == list(range(100, 140))
    assert not standstills(velocity, 41).any()
    assert np.flatnonzero(standstills(velocity, 1)).tolist() == [*range(100, 140), 240]


def test_the_threshold_follows_the_speed_of_the_record() -> None:
    velocity = velocity_with_a_rest()
    assert standstill_threshold(velocity) == 0.005
    velocity[110:120] = 0.004
    assert standstills(velocity, 20)[100:140].all()
    velocity[110:120] = 0.006
    assert not standstills(velocity, 21).any()


def test_a_record_at_rest_stands_still_throughout() -> None:
    assert standstills(np.zeros(50), 10).all()


def test_reversals_are_sign_changes_and_rests() -> None:
    wave = np.cos(np.pi * (np.arange(40) + 0.5) / 10.0)
    assert np.flatnonzero(reversals(wave)).tolist() == [4, 5, 14, 15, 24, 25, 34, 35]
    marked = reversals(velocity_with_a_rest())
    assert np.flatnonzero(marked).tolist() == [*range(99, 141), 239, 240, 241]


def test_motion_in_one_direction_has_no_reversal() -> None:
    assert not reversals(2.0 + np.sin(np.arange(100.0))).any()


def test_widen_marks_the_neighbours_and_stops_at_the_ends() -> None:
    marked = np.zeros(20, dtype=bool)
    marked[[1, 10]] = True
    assert np.flatnonzero(widen(marked, 3)).tolist() == [0, 1, 2, 3, 4, 7, 8, 9, 10, 11, 12, 13]
    np.testing.assert_array_equal(widen(marked, 0), marked)
    assert not widen(np.zeros(5, dtype=bool), 2).any()


SPEEDS = st.lists(st.sampled_from([-2.0, -0.1, 0.0, 0.1, 2.0]), min_size=1, max_size=40).map(np.array)


@pytest.mark.slow
@settings(max_examples=200)
@given(SPEEDS, st.integers(1, 5), st.integers(0, 6), st.sampled_from([0.0, 0.5]))
def test_marks_are_those_that_one_would_make_by_hand(
    velocity: np.ndarray, shortest: int, reach: int, threshold: float
) -> None:
    n, still = len(velocity), np.abs(velocity) <= threshold
    changes = [k for k in range(n - 1) if velocity[k] * velocity[k + 1] <= 0.0]
    changed = np.isin(np.arange(n), [place for k in changes for place in (k, k + 1)])

    def stretch(marked: np.ndarray, k: int) -> slice:
        return slice(
            max((i + 1 for i in range(k) if not marked[i]), default=0),
            min((i for i in range(k, n) if not marked[i]), default=n),
        )

    rests = [still[k] and still[stretch(still, k)].sum() >= shortest for k in range(n)]
    np.testing.assert_array_equal(standstills(velocity, shortest, threshold), rests)
    either = still | changed
    np.testing.assert_array_equal(reversals(velocity, threshold), either)
    turned = [either[k] and changed[stretch(either, k)].any() for k in range(n)]
    np.testing.assert_array_equal(turns(velocity, threshold), turned)
    near = [still[max(k - reach, 0) : k + reach + 1].any() for k in range(n)]
    np.testing.assert_array_equal(widen(still, reach), near)


@pytest.mark.parametrize("least", [1, 2, 3, 4, 7, 30])
def test_rests_are_found_wherever_they_begin(least: int) -> None:
    for start in range(12):
        for length in range(1, 40):
            velocity = np.ones(100)
            velocity[start : start + length] = 0.0
            wanted = (velocity == 0.0) & (length >= least)
            np.testing.assert_array_equal(standstills(velocity, least, 0.5), wanted)
