"""One series -> its change: from an entry on, or for some entries; and how probable it is by chance.

The statistic is the largest difference between two parts of the series in standard deviations (Page,
Biometrika 42, 1955, 523-527; Olshen et al., Biostatistics 5, 2004, 557-572), over all entries from which on
it may have changed, and over runs of entries in between, from one alone on. A mean of entries does not become
more precise than what they share: the systematic part of an entry's deviation stays in that of the mean, and
is taken as another one before the change and after it, since another setting may have brought it about.
Chance is judged by histories drawn without a change, whose systematic errors move where the change was found,
or are others in every entry, whichever makes more of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.numerics.tails import normal_tail
from modelgen.runtime.trend.series import Series
from modelgen.runtime.trend.thresholds import BLOCK, DRAWS, FALSE_ALARMS, FEWEST_DRAWS, MOST_NUMBERS, RUNS


@dataclass(frozen=True, eq=False)
class Difference:
    """The largest difference between two parts of a series.

    `place` and `end` are the first of the entries that differ and the one behind the last, by their indices
    in the series. `before` and `after` are the means of the others and of these, `std` is the standard
    deviation of their difference, `p_value` how probable so large a one is without a change.
    """

    place: int
    end: int
    before: float
    after: float
    std: float
    p_value: float


def largest_difference(series: Series) -> Difference:
    """Return the largest difference of a series of at least two entries."""
    parts = _parts(len(series.values))
    weights = 1.0 / (series.noise**2 + series.drift**2)
    means, std = _contrasts(parts, weights, series)
    differences = means @ series.values
    scaled = np.abs(differences) / std
    best = int(np.argmax(scaled))
    reached = float(scaled[best])
    p_one = 2.0 * normal_tail(reached)
    p_value = len(parts) * p_one  # no more often than each of them alone, added up
    if p_one < FALSE_ALARMS and p_value * DRAWS > 1.0:  # else it is chance, or none, whatever the draws say
        exceeded = _exceeded(reached, means / std[:, None], parts[best], series)
        p_value = min(p_value, exceeded)
    inside = parts[best]
    before = float(weights[~inside] @ series.values[~inside] / weights[~inside].sum())
    place, change = int(np.argmax(inside)), float(differences[best])
    end = place + int(inside.sum())
    return Difference(place, end, before, before + change, float(std[best]), float(min(p_value, 1.0)))


def _parts(count: int) -> BoolArray:
    """Return which entries differ, shape (parts, count): the last ones, or runs of some in between."""
    place = np.arange(count)[None, :]
    found = [place >= np.arange(1, count)[:, None]]
    for length in RUNS:
        first = np.arange(1, count - length)[:, None]
        if not first.size or sum(map(np.size, found)) + first.size * count > MOST_NUMBERS:
            break
        found.append((place >= first) & (place < first + length))
    return np.vstack(found)


def _contrasts(parts: BoolArray, weights: FloatArray, series: Series) -> tuple[FloatArray, FloatArray]:
    """Return what to multiply values with for each difference, shape (parts, k), and its deviation."""
    inside, outside = parts * weights, ~parts * weights
    inside, outside = (one / one.sum(axis=1, keepdims=True) for one in (inside, outside))
    variance = (inside**2 + outside**2) @ series.noise**2
    variance += (inside @ series.drift) ** 2 + (outside @ series.drift) ** 2
    return inside - outside, np.sqrt(variance)


def _exceeded(reached: float, scaled: FloatArray, part: BoolArray, series: Series) -> float:
    """Return the share of histories without a change whose largest difference is as large as this one."""
    count = len(series.values)
    draws = max(min(DRAWS, MOST_NUMBERS // len(scaled)), FEWEST_DRAWS)
    rng = np.random.default_rng(0)
    exceeding = np.zeros(2, dtype=int)
    for start in range(0, draws, BLOCK):
        size = min(BLOCK, draws - start)
        noise = rng.standard_normal((size, count)) * series.noise
        sides, own = rng.standard_normal((size, 2)), rng.standard_normal((size, count))
        moving = np.where(part, sides[:, :1], sides[:, 1:])
        for kind, drift in enumerate((moving, own)):
            largest = np.abs((noise + drift * series.drift) @ scaled.T).max(axis=1)
            exceeding[kind] += np.count_nonzero(largest >= reached)
    return float((1 + exceeding.max()) / (1 + draws))
