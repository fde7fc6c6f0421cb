from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.simulation.arms.fourier_trajectory import FourierTrajectory, at_rest


def random_trajectory(seed: int, joints: int = 3) -> FourierTrajectory:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    sines, cosines = at_rest(*rng.standard_normal((2, joints, n)))
    return FourierTrajectory(float(rng.uniform(0.5, 20.0)), rng.standard_normal(joints), sines, cosines)


@pytest.mark.parametrize("seed", range(10))
def test_bounds_hold_between_samples_and_are_close(seed: int) -> None:
    one = random_trajectory(seed)
    bounds = one.bounds()
    q, speed, acceleration = one.at(np.linspace(0.0, one.period_s, 100_001))
    assert (q.max(axis=1) <= bounds.upper).all() and (q.min(axis=1) >= bounds.lower).all()
    for values, bound in ((speed, bounds.speed), (acceleration, bounds.acceleration)):
        largest = np.abs(values).max(axis=1)
        assert (largest <= bound).all() and (largest > 0.997 * bound).all()
    assert (q.max(axis=1) - q.min(axis=1) > 0.997 * (bounds.upper - bounds.lower)).all()


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_those_of_the_coordinate_and_begin_at_rest(seed: int) -> None:
    one = random_trajectory(seed)
    times, step = one.grid(16), 1e-6 * one.period_s
    q, speed, acceleration = one.at(times)
    before, after = one.at(times - step), one.at(times + step)
    for low, high, rate in ((before[0], after[0], speed), (before[1], after[1], acceleration)):
        np.testing.assert_allclose((high - low) / (2 * step), rate, atol=1e-6 * np.abs(rate).max())
    for end in (0.0, one.period_s):
        at = one.at(np.array([end]))
        for found, values in zip(at[1:], (speed, acceleration), strict=True):
            assert np.abs(found).max() < 1e-9 * np.abs(values).max()
        np.testing.assert_allclose(at[0][:, 0], q[:, 0], atol=1e-9)
