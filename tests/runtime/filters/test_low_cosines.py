import numpy as np
import pytest

from modelgen.runtime.filters import low_cosines
from modelgen.runtime.filters.low_cosines import slowest


@pytest.mark.parametrize("most", [0, 1 << 21], ids=["transformed", "by a table"])
@pytest.mark.parametrize("n, count", [(500, 0), (500, 1), (499, 7), (499, 499)])
def test_the_slowest_cosines_are_those_of_the_mirrored_samples(n, count, most, monkeypatch):
    monkeypatch.setattr(low_cosines, "COSINES_KEPT", most)
    samples = np.random.default_rng(3).normal(size=n).cumsum()
    spectrum = np.fft.rfft(np.concatenate([samples, samples[::-1]]))
    spectrum[count:] = 0.0
    expected = np.fft.irfft(spectrum, 2 * n)[:n]
    np.testing.assert_allclose(slowest(samples, count), expected, atol=1e-12 * np.abs(samples).max())
