"""Jumps of a signal: found beside a motion that is large and a noise that is not, and only as rare events."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.jumps import bends, jumps, steps
from modelgen.runtime.records.record import Record

N = 4000
K = np.arange(N)
SMOOTH = 20.0 * np.sin(2.0 * np.pi * K * (0.01 + 0.04 * K / N)) + 0.01 * np.random.default_rng(1).normal(
    size=N
)


def test_a_jump_is_found_where_it_is() -> None:
    found = jumps(SMOOTH + 0.5 * (K >= 1500))
    assert found.size and np.all(np.abs(found - 1500) <= 8)
    assert np.min(np.abs(found - 1500)) <= 1


def test_so_is_a_corner() -> None:
    found = jumps(SMOOTH + np.clip(1.5 * (K - 2500), 0.0, 30.0))
    assert {min((2500, 2520), key=lambda one: abs(one - place)) for place in found.tolist()} == {2500, 2520}
    assert np.all(np.minimum(np.abs(found - 2500), np.abs(found - 2520)) <= 8)


def test_small_corners_are_told_with_their_size() -> None:
    corners, slopes = [1000, 1020, 3000, 3020], [0.5, -0.5, -0.4, 0.4]
    bent = sum(slope * np.clip(K - at, 0, None) for at, slope in zip(corners, slopes, strict=True))
    places, growth = bends(SMOOTH + bent)
    assert places.tolist() == corners
    np.testing.assert_allclose(growth, slopes, atol=0.25)


def test_corners_that_noise_hides_from_single_samples_are_found_over_several() -> None:
    corners, slopes = [1000, 1020, 3000, 3021], [0.2, -0.2, 0.18, -0.18]
    bent = sum(slope * np.clip(K - at, 0, None) for at, slope in zip(corners, slopes, strict=True))
    slow = 20.0 * np.sin(2.0 * np.pi * 0.02 * K) + 0.0075 * np.random.default_rng(7).normal(size=N)
    # single samples show four times their noise there, as they do once by chance
    places, growth = bends(slow + bent)
    assert len(places) == 4
    assert np.all(np.abs(places - corners) <= 1)
    np.testing.assert_allclose(growth, slopes, atol=0.15)
    # where a filter has rounded the corners there are none
    window = np.hanning(15)[1:-1]
    rounded = np.convolve(np.pad(bent, 6, mode="edge"), window / window.sum(), "valid")
    assert bends(slow + rounded)[0].size == 0


def test_a_steady_motion_and_noise_have_none() -> None:
    assert bends(SMOOTH)[0].size == bends(np.zeros(10))[0].size == 0
    assert jumps(SMOOTH).size == 0
    assert jumps(np.random.default_rng(2).normal(size=100_000)).size == 0


def test_a_signal_without_noise_or_one_that_jumps_all_the_time_has_none() -> None:
    assert jumps(np.where(K < 2000, 0.0, 1.0)).size == 0
    assert jumps(np.where(K // 20 % 2, 1.0, -1.0) + 1e-3 * SMOOTH).size == 0
    assert jumps(np.zeros(10)).size == 0


def test_a_long_channel_is_looked_at_in_stretches() -> None:
    n = 600_000
    samples = np.random.default_rng(3).normal(size=n)
    at = [1 << 18, (1 << 18) + 5000, 599_000]
    for k in at:
        samples[k:] += 400.0
    found = Record({"F": samples}, 1000.0, "run").facts.jumps("F")
    assert sorted({min(at, key=lambda one: abs(one - place)) for place in found.tolist()}) == at
    np.testing.assert_array_equal(found, jumps(samples))


def test_steps_of_a_binary_signal_are_found_with_their_size() -> None:
    rng = np.random.default_rng(3)
    binary = np.repeat(rng.choice([-1.0, 1.0], N // 10), 10)
    slow = np.sin(2.0 * np.pi * 0.002 * K) + 1e-3 * rng.normal(size=N)
    places, sizes = steps(binary + slow)
    change = np.diff(binary)
    assert places.tolist() == (np.flatnonzero(change) + 1).tolist()
    np.testing.assert_allclose(sizes, change[places - 1], atol=0.01)


@pytest.mark.parametrize(("often", "kept"), [(8, 0.7), (16, 0.5), (200, 0.5)])
def test_steps_are_found_that_a_controller_answers_within_samples(often: int, kept: float) -> None:
    rng = np.random.default_rng(8)
    binary = np.repeat(rng.choice([-1.0, 1.0], N // often), often)
    change = np.diff(binary, prepend=binary[:1])
    force = np.zeros(len(binary))
    for k in range(1, len(binary)):
        force[k] = kept * force[k - 1] + change[k]
    places, sizes = steps(force + 2e-3 * rng.normal(size=len(binary)))
    assert places.tolist() == np.flatnonzero(change).tolist()
    np.testing.assert_allclose(sizes, change[places], atol=0.05)


def test_steps_are_found_to_the_noise_where_a_controller_answers_with_what_rings_behind_them() -> None:
    """Of a body on a spring, held by a feedback of its position."""
    rng = np.random.default_rng(4)
    change = np.diff(np.repeat(rng.choice([-1.0, 1.0], N // 5), 5), prepend=1.0)
    taken, force, position = np.cumsum(change), np.zeros(N), np.zeros(N)
    for k in range(2, N):
        position[k] = 1.9 * position[k - 1] - 0.96 * position[k - 2] + 0.02 * force[k - 1]
        force[k] = taken[k] - 2.0 * position[k] - 8.0 * (position[k] - position[k - 1])
    noisy = force + 1e-3 * rng.normal(size=N)
    read = position + 1e-5 * rng.normal(size=N)
    at = np.flatnonzero(change)
    places, sizes = steps(noisy, (read,))
    assert places.tolist() == at[at >= 4].tolist()
    assert np.std(sizes - change[places]) < 1.5e-3


def test_motion_and_noise_take_no_steps() -> None:
    rest_and_ramps = np.clip(K - 2000, 0, 30) + np.clip(np.abs(K - 3000) - 40, 0, 300) * 0.2
    for signal in (
        SMOOTH,
        rest_and_ramps + 0.01 * SMOOTH,
        np.random.default_rng(5).normal(size=N),
        np.zeros(N),
    ):
        assert not steps(signal)[0].size
