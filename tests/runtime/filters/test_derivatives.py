from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.derivatives import differentiate, paper_difference


@pytest.mark.parametrize("times", [1, 2, 3, 4])
def test_eighth_order_differences_are_exact_for_polynomials(times: int) -> None:
    t = np.linspace(-1.0, 1.0, 101)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -0.7, 0.2])
    got = differentiate(polynomial(t), t[1] - t[0], times)
    inside = slice(4 * times, -4 * times)
    np.testing.assert_allclose(got[inside], polynomial.deriv(times)(t)[inside], rtol=0.0, atol=1e-7)


def test_eighth_order_differences_lose_almost_nothing_at_a_tenth_of_the_sampling_frequency() -> None:
    dt, omega = 1e-3, 2.0 * np.pi * 100.0
    t = np.arange(400) * dt
    got = differentiate(np.sin(omega * t), dt)[20:-20]
    np.testing.assert_allclose(got, omega * np.cos(omega * t)[20:-20], atol=5e-5 * omega)


def test_zero_times_returns_the_samples() -> None:
    samples = np.arange(10.0)
    np.testing.assert_array_equal(differentiate(samples, 0.1, 0), samples)
    np.testing.assert_array_equal(paper_difference(samples, 0.1, 0), samples)


def test_a_ramp_keeps_its_slope_up_to_both_ends() -> None:
    np.testing.assert_allclose(differentiate(3.0 * np.arange(12.0), 1.0), 3.0, rtol=1e-13)


def test_paper_difference_is_central_inside_and_one_sided_at_the_ends() -> None:
    samples = np.array([0.0, 1.0, 4.0, 9.0])
    np.testing.assert_allclose(paper_difference(samples, 0.5), [2.0, 4.0, 8.0, 10.0])
    np.testing.assert_allclose(paper_difference(samples, 0.5, 2), [4.0, 6.0, 6.0, 4.0])
