"""To which step readings are rounded: encoders and files."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.rounding import rounding


def fast_motion(n: int = 40_000) -> np.ndarray:
    """Return a position (rad) that goes forth and back, by tens of counts a sample but where it turns."""
    share = np.linspace(0.0, 2.0, n)
    return np.asarray(50.0 * np.sqrt(1e-4 + (share - 1.2345) ** 2) + 0.02 * np.sin(40.0 * share))


@pytest.mark.parametrize("count", [1.3e-5, 2.0 * np.pi / 65536])
@pytest.mark.parametrize("n", [40_000, 400_000])
def test_the_step_shows_where_a_fast_motion_turns(count: float, n: int) -> None:
    read = np.floor(fast_motion(n) / count) * count
    assert rounding(read) == pytest.approx(count, rel=1e-6)


def test_the_least_change_may_be_several_steps() -> None:
    counts = np.array([0, 0, 0, 2, 9, 22, 46, 82, 134, 204, 293, 402, 532, 681, 848, 1029, 1221, 1422, 1627])
    assert rounding(1.7e-5 * counts) == pytest.approx(1.7e-5, rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_few_readings_that_repeat_in_noise_have_no_step(seed: int) -> None:
    readings = np.cumsum(np.random.default_rng(seed).standard_normal(60))
    readings[:5] = readings[0]
    assert rounding(readings) == 0.0


def test_noise_that_repeats_by_chance_has_no_step() -> None:
    noisy = fast_motion() + 1e-4 * np.random.default_rng(0).standard_normal(40_000)
    noisy[20_000:20_006] = noisy[20_000]  # a sensor that stuck
    assert rounding(noisy) == 0.0


def test_a_fast_motion_in_full_precision_has_no_step() -> None:
    assert rounding(fast_motion()) == 0.0
