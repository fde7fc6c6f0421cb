"""Periodic records: their period, declared or found, and the covariance that the spread over periods gives.

Whatever noise does, it does anew in every period. The contributions of the periods to the estimate's error
are then independent samples of it, and their spread needs no model of the noise at all: the covariance of
clusters of Liang and Zeger (1986) with periods as clusters. What is the same in every period, such as
dynamics that the model lacks, does not show in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.least_squares.hac_covariance import influence
from modelgen.runtime.least_squares.wls import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name

FloatArray = npt.NDArray[np.float64]

NONE = "none"
# So many whole periods at least, for a spread; more than so many are taken together.
FEWEST_PERIODS = 4
MOST_CLUSTERS = 50
# A period is found where a force correlates like this with itself one period later, and a declared one is
# taken.
FOUND_CORRELATION = 0.98
LEAST_CORRELATION = 0.7
# Peaks this much below the highest are as good: multiples of a period differ by chance.
SAME_CORRELATION = 2e-3
# The spread counts as larger than the noise beyond the bound that chance passes in 1 % of all records.
CONFIDENCE = 0.99


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
    for index, psi in zip(used, influence(fit), strict=True):
        record = records[index]
        start = next(block.start for block in fit.blocks if block.record == index)
        at = (start + decimation[index] * np.arange(len(psi))) / record.fs
        number = np.floor(at / period_s[record.name] + 1e-9).astype(int)
        number -= number[0]
        together = -(-(int(number[-1]) + 1) // MOST_CLUSTERS)
        sums = np.zeros((int(number[-1]) // together + 1, psi.shape[1]))
        np.add.at(sums, number // together, psi)
        clusters.append(sums)
    parts = np.concatenate(clusters)
    count = len(parts)
    if count < FEWEST_PERIODS:
        return None
    parts = parts - parts.mean(axis=0)
    return PeriodSpread(dict(period_s), count, parts.T @ parts * count / (count - 1))


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
    """Return the advice that names what varies from period to period by more than the noise within them."""
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
        samples = record.signals[key] - record.signals[key].mean()
        if not np.any(samples):
            continue
        lag = _first_peak(samples)
        if lag is not None and all(_correlation(record, other, lag) >= FOUND_CORRELATION for other in forces):
            return lag / record.fs
    return None


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
    samples = record.signals[key] - record.signals[key].mean()
    before, after = samples[:-lag], samples[lag:]
    size = float(np.linalg.norm(before) * np.linalg.norm(after))
    return float(before @ after) / size if size > 0.0 else 1.0


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
