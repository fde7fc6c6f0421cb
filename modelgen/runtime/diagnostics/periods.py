"""Periodic records: their period, declared or found, and the covariance that the spread over periods gives.

Whatever noise does, it does anew in every period. The contributions of the periods to the estimate's error
are then independent samples of it, and their spread needs no model of the noise at all: the covariance of
clusters of Liang and Zeger (1986) with periods as clusters. What is the same in every period, such as
dynamics that the model lacks, does not show in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.thresholds import (
    CONFIDENCE,
    FEWEST_PERIODS,
    FOUND_CORRELATION,
    LEAST_CORRELATION,
    MOST_CLUSTERS,
    SAME_CORRELATION,
)
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import influence_parts
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import READ_SAMPLES, in_stretches
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.thresholds import WHOLE

NONE = "none"


@dataclass(frozen=True, eq=False)
class PeriodSpread:
    """Covariance from the spread over periods, shape (c, c), in the order of the fit's columns.

    `period_s` maps records to periods in s, `count` says how many periods (or groups of them) there are.
    """

    period_s: Mapping[str, float]
    count: int
    covariance: FloatArray


def periods_of(
    model: Model, records: Sequence[Record], declared: float | Mapping[str, float] | str | None
) -> dict[str, float]:
    """Return the period in s of every periodic record.

    Parameters
    ----------
    declared : float, mapping of str to float, "none" or None
        Period in s of all records or by record; None finds periods, "none" looks for none.

    Raises
    ------
    DataError
        When a declared period is not positive, shorter than two samples, too long for four of them, not the
        forces' own, or that of no record.
    """
    if isinstance(declared, str):
        if declared != NONE:
            raise DataError.at("period_s", f"is {declared!r}", f'give seconds, or "{NONE}"')
        return {}
    forces = [actuator.key for actuator in model.actuators if actuator.key in model.channels]
    if declared is None:
        found = {record.name: _found_period(record, forces) for record in records}
        return {name: period for name, period in found.items() if period is not None}
    names = [record.name for record in records]
    given = declared if isinstance(declared, Mapping) else dict.fromkeys(names, float(declared))
    problems = [missing_name("period_s", "record", name, names) for name in given if name not in names]
    for record in records:
        if record.name in given:
            problems += _period_problems(record, forces, given[record.name])
    if problems:
        raise DataError(*problems)
    return {name: float(given[name]) for name in names if name in given}


def period_spread(
    fit: Fit, records: Sequence[Record], decimation: Sequence[int], period_s: Mapping[str, float]
) -> PeriodSpread | None:
    """Return the covariance from the spread over periods; None unless every record of the fit is periodic."""
    used = list(dict.fromkeys(block.record for block in fit.blocks))
    if not all(records[index].name in period_s for index in used):
        return None
    clusters = []
    for index, parts in zip(used, influence_parts(fit), strict=True):
        record, block = records[index], next(block for block in fit.blocks if block.record == index)
        instants = block.start / record.fs, decimation[index] / record.fs, period_s[record.name]
        last = int(_periods_since(*instants, np.array([block.grid - 1]))[0])
        together = -(-(last + 1) // MOST_CLUSTERS)
        sums, first = np.zeros((last // together + 1, len(fit.columns))), 0
        for psi in parts():
            number = _periods_since(*instants, np.arange(first, first + len(psi)))
            np.add.at(sums, number // together, psi)
            first += len(psi)
        clusters.append(sums)
    found = np.concatenate(clusters)
    count = len(found)
    if count < FEWEST_PERIODS:
        return None
    found = found - found.mean(axis=0)
    return PeriodSpread(dict(period_s), count, found.T @ found * count / (count - 1))


def _periods_since(start_s: float, step_s: float, period_s: float, points: IntArray) -> IntArray:
    """Return how many periods after that of the first point of a grid points of it lie, shape (n,)."""
    of = [np.floor((start_s + step_s * at) / period_s + 1e-9) for at in (points, np.zeros(1))]
    return np.asarray(of[0] - of[1], dtype=np.int64)


def spread_beyond_noise(found: PeriodSpread, noise: FloatArray) -> FloatArray:
    """Return what the spread over periods adds to the noise's covariance, shape (c, c): mostly nothing.

    Noise that changes from period to period (drift, temperature) hides from residuals within a period.
    """
    from scipy.stats import chi2

    own, theirs = np.diag(found.covariance), np.diag(noise)
    limit = float(chi2.isf((1.0 - CONFIDENCE) / len(own), found.count - 1)) / (found.count - 1)
    more = np.where(own > limit * theirs, np.maximum(own - theirs, 0.0), 0.0)
    return np.asarray(np.diag(more))


def period_advice(found: PeriodSpread, noise: FloatArray, columns: Sequence[str]) -> tuple[Advice, ...]:
    """Return the advice that names what varies from period to period by more than the noise within them.

    `noise` is the covariance that the residuals explain, shape (c, c), in the order of `columns`.
    """
    more = np.diag(spread_beyond_noise(found, noise))
    named = [name for name, variance in zip(columns, more, strict=True) if variance > 0.0]
    if not named:
        return ()
    return (
        Advice(
            "periods differ",
            ", ".join(named),
            f"varies over the {found.count} periods by more than the noise within them explains",
            "something drifts (temperature, friction); the intervals include it",
        ),
    )


def _found_period(record: Record, forces: Sequence[str]) -> float | None:
    """Return the period in s with which every force that changes repeats itself; None without one."""
    for key in forces:
        if record.facts.extent(key).span == 0.0:
            continue
        lag = _first_lag(record, key)
        if lag is not None and all(_correlation(record, other, lag) >= FOUND_CORRELATION for other in forces):
            return lag / record.fs
    return None


def _first_lag(record: Record, key: str) -> int | None:
    """Return the smallest lag, in samples, after which a force repeats itself; None where it does not.

    In a long record it is found on means of neighbouring samples, and then sharpened on the samples.
    """
    every, mean = -(-record.n // WHOLE), record.facts.extent(key).mean
    lag = _first_peak(np.concatenate(list(_means(record, key, every))) - mean)
    if lag is None or every == 1:
        return lag
    low = every * (lag - 1)
    m = min(WHOLE, record.n - low - 2 * every)
    before, after = record.read(key, 0, m) - mean, record.read(key, low, low + m + 2 * every) - mean
    size = quick_length(len(after) + m)
    products = np.fft.irfft(np.conj(np.fft.rfft(before, size)) * np.fft.rfft(after, size), size)
    return low + int(np.argmax(products[: 2 * every + 1]))


def _means(record: Record, key: str, every: int) -> Iterator[FloatArray]:
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
    size = quick_length(2 * n)
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


def _correlation(record: Record, key: str, lag: int) -> float:
    """Return how a channel correlates with itself `lag` samples later; 1 where it never changes."""
    mean = record.facts.extent(key).mean
    sums = np.zeros(3)
    for start in range(0, record.n - lag, READ_SAMPLES):
        stop = min(start + READ_SAMPLES, record.n - lag)
        before, after = (record.read(key, start + by, stop + by) - mean for by in (0, lag))
        sums += before @ after, before @ before, after @ after
    size = float(np.sqrt(sums[1]) * np.sqrt(sums[2]))
    return float(sums[0]) / size if size > 0.0 else 1.0


def _period_problems(record: Record, forces: Sequence[str], period_s: float) -> list[Problem]:
    """Return what is wrong with a declared period."""
    where = f"{record.name}: period_s"
    if not 2.0 < period_s * record.fs < np.inf:
        return [Problem(where, f"is {period_s!r}", "give the period in s, longer than two samples")]
    if record.duration_s < FEWEST_PERIODS * period_s * (1.0 - 1e-9):
        what = f"is {period_s:g} s, and {record.duration_s:g} s hold fewer than {FEWEST_PERIODS} periods"
        return [Problem(where, what, "record more periods, or do not declare one")]
    correlations = {key: _correlation(record, key, round(period_s * record.fs)) for key in forces}
    worst = min(correlations, key=lambda key: correlations[key], default=None)
    if worst is None or correlations[worst] >= LEAST_CORRELATION:
        return []
    own = _found_period(record, forces)
    remedy = f"it repeats every {own:g} s" if own else "give the excitation's own period, or none"
    what = f"is {period_s:g} s, but {worst} does not repeat then (correlation {correlations[worst]:.2f})"
    return [Problem(where, what, remedy)]
