from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import decimation_start, matlab_decimate, support_samples, zero_phase


@pytest.mark.parametrize("frequency_hz", [10.0, 30.0, 43.0, 80.0])
def test_two_passes_have_the_stated_amplitude_and_no_phase(frequency_hz: float) -> None:
    fs, order, cutoff_hz = 5000.0, 4, 43.0
    t = np.arange(10000) / fs
    wave = np.sin(2.0 * np.pi * frequency_hz * t)
    got = zero_phase(wave, order, cutoff_hz, fs)[3000:-3000]
    amplitude = 1.0 / (1.0 + (frequency_hz / cutoff_hz) ** (2 * order))
    np.testing.assert_allclose(got, amplitude * wave[3000:-3000], atol=2e-3)


@pytest.mark.parametrize("derivative", [0, 1, 2, 4])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_nothing_is_felt_beyond_the_support(derivative: int, tolerance: float) -> None:
    order, cutoff_hz, fs = 6, 200.0, 5000.0
    reach = support_samples(order, cutoff_hz, fs, derivative, tolerance)
    impulse = np.zeros(4001)
    impulse[2000] = 1.0
    response = np.abs(differentiate(zero_phase(impulse, order, cutoff_hz, fs), 1.0, derivative))
    beyond = np.abs(np.arange(4001) - 2000) >= reach
    assert response[beyond].max() <= tolerance * response.max() * (1.0 + 1e-6)
    at_the_border = response[2000 + reach - 1]
    assert at_the_border > tolerance * response.max()


def test_support_grows_with_sampling_frequency_and_precision() -> None:
    slow, fast = (support_samples(4, 43.0, fs, 2, 1e-5) for fs in (1000.0, 4000.0))
    assert fast == pytest.approx(4 * slow, rel=0.05)
    assert slow > 100  # the ends that the EMPS record must lose
    assert support_samples(4, 43.0, 1000.0, 2, 1e-3) < slow


def test_decimate_keeps_the_samples_that_matlab_keeps() -> None:
    # decimate(1:24792, 10) keeps the 2nd, 12th, ... sample: its last is the record's last
    assert decimation_start(24792, 10) == 1
    assert decimation_start(100, 10) == 9
    assert decimation_start(101, 10) == 0
    ramp = np.arange(1001.0)
    # an even Chebyshev filter passes a constant with its ripple, here twice: MATLAB's loses 0.1 dB as well
    gain = 10.0 ** (-2.0 * 0.05 / 20.0)
    np.testing.assert_allclose(matlab_decimate(ramp, 10)[5:-5], gain * ramp[0::10][5:-5], rtol=1e-3)


def test_decimate_works_on_columns_and_leaves_factor_one_alone() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((500, 3))
    together = matlab_decimate(columns, 4)
    for index in range(3):
        np.testing.assert_allclose(together[:, index], matlab_decimate(columns[:, index], 4), atol=1e-12)
    assert matlab_decimate(columns, 1) is columns
