"""Stamps are believed where the samples scatter with them, and where nothing says that they do not."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.records.faults import even_times
from modelgen.runtime.records.repair import Track, mend_times

N, DT = 4000, 1e-3
K = np.arange(N)


def motion(times: FloatArray) -> FloatArray:
    return np.sin(40.0 * times) + 0.3 * np.sin(97.0 * times)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
@pytest.mark.parametrize("missing", [False, True])
def test_scatter_of_stamps_alone_is_told_from_that_of_samples(noise: float, missing: bool) -> None:
    rng = np.random.default_rng(2)
    late = rng.uniform(-0.3 * DT, 0.3 * DT, N)
    kept = np.delete(K, range(700, 708)) if missing else K
    scatter = noise * rng.standard_normal(N)
    for read_at, believed in ((K * DT, False), (K * DT + late, True)):
        stamps, q = (K * DT + late)[kept], (motion(read_at) + scatter)[kept]
        even = even_times(stamps, {"q": q, "still": np.zeros(kept.size)})
        assert (even is None) == believed
        if even is not None:
            np.testing.assert_allclose(even, kept * DT, atol=0.02 * DT)


def test_stamps_that_nothing_contradicts_are_believed() -> None:
    rng = np.random.default_rng(3)
    late = rng.uniform(-0.2 * DT, 0.2 * DT, N)
    # noise hides the scatter; there is no scatter; the clock wanders; samples are few
    loud = motion(K * DT) + rng.standard_normal(N)
    assert even_times(K * DT + late, {"q": loud}) is None
    assert even_times(K * DT, {"q": motion(K * DT)}) is None
    wanders = K * DT + 0.3 * DT * np.sin(2.0 * np.pi * K / 700.0)
    assert even_times(wanders, {"q": motion(K * DT)}) is None
    assert even_times((K * DT + late)[:50], {"q": motion(K * DT)[:50]}) is None
    assert even_times(K * DT + late, {"q": np.full(N, np.nan), "none": np.zeros(N, dtype=bool)}) is None


def test_a_mended_record_keeps_samples_that_were_read_evenly() -> None:
    late = np.random.default_rng(4).normal(0.0, 0.1 * DT, N)
    q = motion(K * DT)
    mended = mend_times(Track(K * DT + late, {"q": q}), ("uneven",))
    assert mended.said[0].startswith("stamps scatter by 0.0997 ms (rms)")
    assert mended.said[0].endswith("which no channel shows: samples taken as read at even times")
    np.testing.assert_allclose(mended.signals["q"], q, atol=1e-12)
    np.testing.assert_allclose(np.diff(mended.times), DT, rtol=1e-4)
