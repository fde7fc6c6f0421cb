"""The period of a record, found by its correlation with itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.records.channels import READ_SAMPLES, Channels, in_stretches
from modelgen.runtime.records.thresholds import (
    FEWEST_PERIODS,
    FOUND_CORRELATION,
    LEAST_CORRELATION,
    SAME_CORRELATION,
    WHOLE,
)

if TYPE_CHECKING:
    from modelgen.runtime.records.record import Record


def found_period(record: Record, forces: Sequence[str]) -> float | None:
    """Return the period in s with which every force that changes repeats itself; None without one."""
    for key in forces:
        if record.facts.extent(key).span == 0.0:
            continue
        lag = record.facts.lag(key)
        if lag is not None and all(
            lag_correlation(record, other, lag) >= FOUND_CORRELATION for other in forces
        ):
            return lag / record.fs
    return None


def first_lag(record: Channels, key: str, mean: float) -> int | None:
    """Return the smallest lag, in samples, after which a channel repeats itself; None where it does not.

    `mean` is the channel's. In a long record the lag is found on means of neighbouring samples, and then
    sharpened on the samples.
    """
    every = -(-record.n // WHOLE)
    lag = _first_peak(np.concatenate(list(_means(record, key, every))) - mean)
    if lag is None or every == 1:
        return lag
    low = every * (lag - 1)
    m = min(WHOLE, record.n - low - 2 * every)
    before, after = record.read(key, 0, m) - mean, record.read(key, low, low + m + 2 * every) - mean
    # of few lags: a transform would give all
    return low + int(np.argmax(np.correlate(after, before, "valid")))


def _means(record: Channels, key: str, every: int) -> Iterator[FloatArray]:
    """Yield the means of so many neighbouring samples each, stretch by stretch."""
    left = np.zeros(0)
    for part in in_stretches(record, key):
        samples = np.concatenate([left, part])
        whole = len(samples) // every * every
        left = samples[whole:]
        yield samples[:whole].reshape(-1, every).mean(axis=1)


def _first_peak(samples: FloatArray) -> int | None:
    """Return the smallest lag, in samples, at which a series is as good as itself again."""
    n = len(samples)
    most = n // FEWEST_PERIODS
    if most < 3:
        return None
    # longer lags may come round
    size = quick_length(n + most + 1)
    spectrum = np.fft.rfft(samples, size)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size)[: most + 1]
    energy = np.cumsum(np.concatenate([[0.0], samples**2]))
    lags = np.arange(most + 1)
    both = np.sqrt((energy[n] - energy[lags]) * energy[n - lags])
    correlation = products / np.maximum(both, np.finfo(float).tiny)
    below = np.flatnonzero(correlation < LEAST_CORRELATION)
    if not below.size or below[0] >= most:
        return None
    rest = correlation[below[0] :]
    highest = float(rest[:-1].max())
    if highest < FOUND_CORRELATION:
        return None
    peaks = np.flatnonzero((rest[1:-1] >= rest[:-2]) & (rest[1:-1] >= rest[2:])) + 1
    good = peaks[rest[peaks] >= highest - SAME_CORRELATION]
    return int(below[0] + good[0]) if good.size else None


def lag_correlation(record: Record, key: str, lag: int) -> float:
    """Return how a channel correlates with itself `lag` samples later; 1 where it never changes."""
    mean = record.facts.extent(key).mean
    sums = np.zeros(3)
    for start in range(0, record.n - lag, READ_SAMPLES):
        stop = min(start + READ_SAMPLES, record.n - lag)
        before, after = (record.read(key, start + by, stop + by) - mean for by in (0, lag))
        sums += before @ after, before @ before, after @ after
    size = float(np.sqrt(sums[1]) * np.sqrt(sums[2]))
    return float(sums[0]) / size if size > 0.0 else 1.0
