"""Long series -> lowest and highest value of every interval, which keep all peaks visible."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.records.channels import READ_SAMPLES, Channels, in_stretches


def buckets(values: FloatArray, step: int) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest of every `step` values, in their unit, shape (n,); NaN where all are."""
    count = -(-values.size // step)
    padded = np.full(count * step, np.nan)
    padded[: values.size] = values
    table = padded.reshape(count, step)
    missing = np.isnan(table)
    low = np.where(missing, np.inf, table).min(axis=1)
    high = np.where(missing, -np.inf, table).max(axis=1)
    empty = missing.all(axis=1)
    low[empty], high[empty] = np.nan, np.nan
    return low, high


def channel_buckets(source: Channels, channel: str, most: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times in s and the lowest and highest reading of each of at most `most` intervals.

    All have shape (intervals,). A channel of any length is read in stretches; of a short one each sample is
    an interval.
    """
    step = max(1, -(-source.n // most))
    length = max(READ_SAMPLES // step, 1) * step
    found = [buckets(part, step) for part in in_stretches(source, channel, length)]
    low, high = (np.concatenate(ends) for ends in zip(*found, strict=True))
    time_s = np.arange(low.size, dtype=float) * (step / source.fs)
    return time_s, np.asarray(low), np.asarray(high)
