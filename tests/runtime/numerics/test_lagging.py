"""What the damping of a spring delays is exact at any lag, whatever the stretch."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.lagging import lag_reach, lagging, series

FS = 1000.0
OMEGA = 2.0 * np.pi * np.array([3.0, 10.0, 30.0])


def tones(samples: int, lag: float = 0.0) -> list[np.ndarray]:
    """Return tones behind a lag, with two derivatives, shape (samples,) each."""
    t = np.arange(samples) / FS
    return [
        np.sum([np.real((1j * w) ** k * np.exp(1j * w * t) / (1.0 + 1j * w * lag)) for w in OMEGA], axis=0)
        for k in range(3)
    ]


@pytest.mark.parametrize("lag", [0.0, 1e-7, 1e-5, 6e-4, 5e-3, 0.03, -6e-4, -5e-3])
def test_tones_lag_as_the_equation_says(lag: float) -> None:
    felt = lag_reach(lag, FS)
    inside = slice(felt, -felt or None)
    off = lagging(tones(4000), lag, FS) - tones(4000, lag)[0]
    assert np.abs(off[inside]).max() < 1e-8


def test_the_series_ends_early() -> None:
    """It is what noise is followed by; a deflection that lags needs more."""
    off = series(tones(4000), 5e-3)[0] - tones(4000, 5e-3)[0]
    assert np.abs(off).max() > 0.1


@pytest.mark.parametrize("lag", [6e-4, -5e-3])
def test_a_stretch_is_part_of_the_whole(lag: float) -> None:
    whole = lagging(tones(4000), lag, FS)
    part = lagging([value[1000:3000] for value in tones(4000)], lag, FS)
    felt = lag_reach(lag, FS)
    np.testing.assert_allclose(part[felt:-felt], whole[1000 + felt : 3000 - felt], atol=1e-10)


def test_a_lag_beyond_all_bounds_is_looked_at_so_far_only() -> None:
    assert lag_reach(float("inf"), FS) == lag_reach(1e3, FS)
