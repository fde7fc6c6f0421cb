"""Roots of guards, and the power series they come from."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from scipy.linalg import expm

from modelgen.runtime.stick_slip.root_finding import (
    LARGEST_NORM,
    TERMS,
    power_series,
    value_at,
    when_negative,
)


def padded(*coefficients: float) -> np.ndarray:
    return np.r_[coefficients, np.zeros(TERMS - len(coefficients))]


def test_the_series_is_the_matrix_exponential_up_to_the_largest_norm() -> None:
    rng = np.random.default_rng(0)
    M = rng.normal(size=(5, 5))
    M *= LARGEST_NORM / np.abs(M).sum(axis=0).max()
    z = rng.normal(size=5)
    for u in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(value_at(power_series(M, z), u), expm(u * M) @ z, atol=5e-15)


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [
        ((1.0,), None),
        ((1.0, -0.5), None),
        ((1.0, -4.0), 0.25),
        ((1.0, -1.0), None),  # reaches zero at the end, and does not pass it
        ((0.0,), None),
        ((0.0, 1.0), None),
        ((0.0, -1.0), 0.0),
        ((0.0, 1.0, -2.0), 0.5),  # leaves its limit, and comes back
        ((0.0, 0.0, 1.0, -4.0), 0.25),
        ((0.0, 0.0, -1.0), 0.0),
        ((-1e-20, 1.0), None),  # below by rounding, on its way up
        ((-1e-20, 1.0, -2.0), 0.5),
    ],
)
def test_the_first_moment_below_zero(coefficients: tuple[float, ...], expected: float | None) -> None:
    found = when_negative(padded(*coefficients))
    assert found == pytest.approx(2.0 if expected is None else expected, abs=1e-15)


def test_a_dip_between_the_grid_points_is_found() -> None:
    centre, depth = 0.44, 1e-10
    found = when_negative(padded(centre**2 - depth, -2.0 * centre, 1.0))
    assert found == pytest.approx(centre - depth**0.5, abs=1e-12)
    assert when_negative(padded(centre**2 + depth, -2.0 * centre, 1.0)) == 2.0


def test_a_root_is_exact_to_rounding() -> None:
    # exp(-u) = 1/2
    series = power_series(np.array([[-1.0, 0.0], [0.0, 0.0]]), np.array([1.0, 1.0]))
    found = when_negative(series @ np.array([1.0, -exp(-0.5)]))
    assert found == pytest.approx(0.5, abs=1e-15)
