from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.derivatives import (
    EIGHTH_ORDER,
    HALF_WIDTHS,
    central_difference,
    differentiate,
    integral,
    paper_difference,
    relative_gain,
    stencil_for,
)
from modelgen.runtime.filters.thresholds import LARGEST_ERROR


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


@pytest.mark.parametrize("half_width", HALF_WIDTHS)
def test_a_central_difference_is_exact_up_to_twice_its_half_width(half_width: int) -> None:
    stencil = central_difference(half_width)
    k = np.arange(1, half_width + 1)
    assert 2.0 * np.sum(k * np.array(stencil)) == pytest.approx(1.0, rel=1e-12)
    # odd powers below the order vanish at 0; in exact arithmetic, which floats of this size hold to 1e-9
    for power in range(3, min(2 * half_width, 12), 2):
        terms = np.array(stencil) * (k / half_width) ** power
        assert abs(np.sum(terms)) < 1e-9 * np.max(np.abs(terms))


def test_the_difference_of_order_eight_is_the_one_of_half_width_four() -> None:
    np.testing.assert_allclose(central_difference(4), EIGHTH_ORDER, rtol=1e-15)


@pytest.mark.parametrize("share", [0.001, 0.02, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3])
def test_a_difference_is_chosen_by_what_the_filter_lets_by(share: float) -> None:
    fs, t = 1000.0, np.arange(4000) / 1000.0
    stencil = stencil_for(share * fs, fs)
    for frequency_hz in (0.3 * share * fs, share * fs):
        omega = 2.0 * np.pi * frequency_hz
        assert relative_gain(stencil, frequency_hz / fs) == pytest.approx(1.0, abs=LARGEST_ERROR)
        slope = differentiate(np.sin(omega * t), 1.0 / fs, 2, stencil)[300:-300]
        np.testing.assert_allclose(
            slope, -(omega**2) * np.sin(omega * t)[300:-300], atol=3.0 * LARGEST_ERROR * omega**2
        )
    # no wider than that takes
    narrower = [width for width in HALF_WIDTHS if width < len(stencil)]
    for width in narrower:
        assert abs(relative_gain(central_difference(width), 1.3 * share) - 1.0) > LARGEST_ERROR


def test_far_up_the_widest_difference_is_as_good_as_any() -> None:
    assert len(stencil_for(450.0, 1000.0)) == HALF_WIDTHS[-1]


def test_an_integral_loses_little_up_to_a_sixth_of_the_sampling_frequency() -> None:
    t, omega = np.arange(600.0), 2.0 * np.pi / 6.0
    found = integral(np.cos(omega * t), 1.0)[20:-20]
    wanted = (np.sin(omega * t) / omega)[20:-20]
    found, wanted = found - np.mean(found), wanted - np.mean(wanted)
    assert np.max(np.abs(found - wanted)) < 3e-4 / omega
