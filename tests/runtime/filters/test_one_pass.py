"""Butterworth sections and passes against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import next_fast_len
from scipy.signal import butter, lfilter, sosfilt, sosfilt_zi, sosfiltfilt, sosfreqz

from modelgen.errors import DataError
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.one_pass import BLOCK, one_pass, one_pole
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.filters.zero_phase import zero_phase

ORDERS = range(1, 9)
CUTOFFS = (1e-4, 3e-3, 0.04, 0.2, 0.45, 0.4999)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", CUTOFFS)
def test_sections_are_those_of_scipy(order: int, cutoff: float) -> None:
    frequency = np.geomspace(0.01 * cutoff, 0.499, 200)
    got = sosfreqz(np.array(butterworth(order, cutoff * 700.0, 700.0)), frequency, fs=1.0)[1]
    expected = sosfreqz(butter(order, cutoff, output="sos", fs=1.0), frequency, fs=1.0)[1]
    # SciPy's sum of coefficients loses digits near 0 Hz
    np.testing.assert_allclose(got, expected, rtol=1e-14 / cutoff**2 + 1e-10, atol=1e-12)


@pytest.mark.parametrize("cutoff_hz", [0.0, -1.0, 50.0, 80.0, np.nan])
def test_a_cutoff_outside_the_band_is_refused(cutoff_hz: float) -> None:
    with pytest.raises(DataError, match="half the sampling frequency"):
        butterworth(4, cutoff_hz, 100.0)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", [1e-6, *CUTOFFS[1:5]])
@pytest.mark.parametrize("n", [40, BLOCK, 5 * BLOCK + 1, 3001])
def test_passes_are_those_of_scipy(order: int, cutoff: float, n: int) -> None:
    rng = np.random.default_rng(n + order)
    samples = 3.0 + np.cumsum(rng.standard_normal(n))
    sections = butterworth(order, cutoff, 1.0)
    sos, size = np.array(sections), np.abs(samples).max()
    if cutoff > 1e-5:  # else the response is too long for a table
        found = one_pass(sections)
        np.testing.assert_allclose(found.apply(samples), sosfilt(sos, samples), atol=1e-10 * size)
        steady, _ = sosfilt(sos, samples, zi=sosfilt_zi(sos) * samples[0])
        np.testing.assert_allclose(found.apply(samples, steady=True), steady, atol=1e-10 * size)
    both = sosfiltfilt(sos, samples, padtype="odd", padlen=3 * order)
    np.testing.assert_allclose(zero_phase(samples, order, cutoff, 1.0), both, atol=1e-10 * size)


@pytest.mark.parametrize("tau", [0.01, 0.5, 3.0, 200.0])
def test_a_lag_of_first_order_is_that_of_scipy(tau: float) -> None:
    samples = np.random.default_rng(1).standard_normal(1000)
    expected = lfilter([0.5, 0.5], [0.5 + tau, 0.5 - tau], samples)
    got = one_pass(((0.5, 0.5, 0.0, 0.5 + tau, 0.5 - tau, 0.0),)).apply(samples)
    np.testing.assert_allclose(got, expected, atol=1e-12)


@pytest.mark.parametrize("pole", [-0.5, 0.0, 0.3, 0.999, 1.0 - 1e-9])
@pytest.mark.parametrize("n", [40, BLOCK, 3001])
def test_one_pole_is_that_of_scipy(pole: float, n: int) -> None:
    samples = np.random.default_rng(2).standard_normal(n)
    np.testing.assert_allclose(
        one_pole(pole).apply(samples), lfilter([1.0], [1.0, -pole], samples), atol=1e-10
    )


def test_lengths_for_transforms_are_those_of_scipy() -> None:
    rng = np.random.default_rng(0)
    for n in (*range(1, 2000), *rng.integers(2000, 10**9, 300).tolist()):
        assert quick_length(n) == next_fast_len(n, real=True)
