from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.power_spectrum import (
    band_limit_hz,
    integer_power,
    power_spectrum,
    share_below,
)

FS = 1000.0
T = np.arange(8000) / FS


def two_tones(derivative: int) -> np.ndarray:
    """A tone of 5 Hz and one of 80 Hz whose `derivative`-th derivatives have amplitudes 3 and 1."""
    slow, fast = 2.0 * np.pi * 5.0, 2.0 * np.pi * 80.0
    shift = -0.5 * np.pi * derivative
    slow_part = 3.0 * slow**-derivative * np.sin(slow * T + shift)
    return np.asarray(slow_part + fast**-derivative * np.sin(fast * T + shift))


@pytest.mark.parametrize("derivative", [-1, 0, 1, 2])
def test_power_is_that_of_the_derivative(derivative: int) -> None:
    frequency_hz, power = power_spectrum(two_tones(derivative), FS, derivative)
    ratio = power[frequency_hz < 40.0].sum() / power[frequency_hz > 40.0].sum()
    assert ratio == pytest.approx(9.0, rel=1e-3)


def test_a_position_that_travels_far_does_not_hide_its_vibration() -> None:
    travelling = 300.0 * T + 1e-4 * np.sin(2.0 * np.pi * 90.0 * T)
    assert band_limit_hz(*power_spectrum(travelling, FS, 2), 0.5, 500.0) == pytest.approx(90.0, abs=0.5)


def test_noise_of_a_position_is_no_acceleration() -> None:
    rng = np.random.default_rng(0)
    noisy = np.sin(2.0 * np.pi * 20.0 * T) + 1e-3 * rng.standard_normal(T.size)
    assert band_limit_hz(*power_spectrum(noisy, FS, 2), 0.998, 500.0) == pytest.approx(20.0, abs=1.0)


def test_a_flat_spectrum_is_taken_as_it_is() -> None:
    white = np.random.default_rng(1).standard_normal(20000)
    assert band_limit_hz(*power_spectrum(white, FS), 0.5, 500.0) == pytest.approx(250.0, rel=0.05)


def test_band_limit_counts_only_up_to_the_given_frequency() -> None:
    spectrum = power_spectrum(two_tones(0), FS)
    assert band_limit_hz(*spectrum, 0.999, 500.0) == pytest.approx(80.0, abs=0.5)
    assert band_limit_hz(*spectrum, 0.999, 50.0) == pytest.approx(5.0, abs=0.5)


def test_nothing_has_no_band_and_no_share() -> None:
    spectrum = power_spectrum(np.zeros(100), FS)
    assert band_limit_hz(*spectrum, 0.99, 500.0) is None
    assert share_below(*spectrum, 10.0) == 0.0


def test_a_constant_velocity_counts_as_slow_where_the_mean_is_kept() -> None:
    position = 2.0 * T + 0.01 * np.sin(2.0 * np.pi * 50.0 * T)
    kept = power_spectrum(position, FS, 1, keep_mean=True)
    removed = power_spectrum(position, FS, 1)
    assert share_below(*kept, 5.0) > 0.2
    assert share_below(*removed, 5.0) < 1e-3


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 4, 7, 20])
def test_integer_powers_are_those_of_numpy(exponent: int) -> None:
    samples = np.geomspace(1e-6, 1e6, 101)
    np.testing.assert_allclose(integer_power(samples, exponent), samples**exponent, rtol=1e-14)
