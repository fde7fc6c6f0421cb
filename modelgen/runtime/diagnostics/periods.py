"""Periodic records: their period, declared or found, and the covariance that the spread over periods gives.

Whatever noise does, it does anew in every period. The contributions of the periods to the estimate's error
are then independent samples of it, and their spread needs no model of the noise at all: the covariance of
clusters of Liang and Zeger (1986) with periods as clusters. What is the same in every period, such as
dynamics that the model lacks, does not show in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.thresholds import CONFIDENCE, MOST_CLUSTERS
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import influence_parts
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import chi_square_beyond
from modelgen.runtime.records.period import found_period, lag_correlation
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.thresholds import FEWEST_PERIODS, LEAST_CORRELATION

NONE = "none"


@dataclass(frozen=True, eq=False)
class PeriodSpread:
    """Covariance from the spread over periods, shape (c, c), in the order of the fit's columns.

    `period_s` maps records to periods in s, `count` says how many periods (or groups of them) there are.
    `smooth` is the variance of each column, shape (c,), from sums over triangles of two periods each, and
    `degrees` how many degrees of freedom it has, 0 where there are too few periods for it.
    """

    period_s: Mapping[str, float]
    count: int
    covariance: FloatArray
    smooth: FloatArray
    degrees: int


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
        found = {record.name: found_period(record, forces) for record in records}
        return {name: period for name, period in found.items() if period is not None}
    names = [record.name for record in records]
    given = declared if isinstance(declared, Mapping) else dict.fromkeys(names, float(declared))
    problems = [missing_name("period_s", "record", name, names) for name in given if name not in names]
    for record in records:
        if record.name in given:
            problems += _period_problems(record, forces, given[record.name])
    DataError.raise_any(problems)
    return {name: float(given[name]) for name in names if name in given}


def period_spread(
    fit: Fit, records: Sequence[Record], decimation: Sequence[int], period_s: Mapping[str, float]
) -> PeriodSpread | None:
    """Return the covariance from the spread over periods; None unless every record of the fit is periodic."""
    used = list(dict.fromkeys(block.record for block in fit.blocks))
    if not all(records[index].name in period_s for index in used):
        return None
    clusters, triangles = [], []
    for index, parts in zip(used, influence_parts(fit), strict=True):
        record, block = records[index], next(block for block in fit.blocks if block.record == index)
        instants = block.start / record.fs, decimation[index] / record.fs, period_s[record.name]
        last = int(_periods_since(*instants, np.array([block.grid - 1]))[0])
        together = -(-(last + 1) // MOST_CLUSTERS)
        sums, first = np.zeros((last // together + 1, len(fit.columns))), 0
        rising, falling = np.zeros((2, last // together + 3, len(fit.columns)))
        length = together * instants[2] / instants[1]
        for psi in parts():
            points = np.arange(first, first + len(psi))
            np.add.at(sums, _periods_since(*instants, points) // together, psi)
            at = (points / length + 1e-9).astype(np.int64)
            share = (points / length - at)[:, None]
            np.add.at(rising, at, share * psi)
            np.add.at(falling, at, (1.0 - share) * psi)
            first += len(psi)
        clusters.append(sums)
        whole = int(block.grid / length + 1e-9)
        triangles.append(rising[: max(whole - 1, 0)] + falling[1 : max(whole, 1)])
    found = np.concatenate(clusters)
    count = len(found)
    if count < FEWEST_PERIODS:
        return None
    found = found - found.mean(axis=0)
    covariance = found.T @ found * count / (count - 1)
    return PeriodSpread(dict(period_s), count, covariance, *_smooth(triangles, count))


def _smooth(triangles: Sequence[FloatArray], periods: int) -> tuple[FloatArray, int]:
    """Return the variance that sums over triangles give so many periods, (c,), and its degrees of freedom.

    Noise of differentiated readings is large at both ends of a sum over one period, with opposite signs in
    neighbours, and is not there in the sum over all. A triangle over two periods has no ends; where noise is
    white beyond a period its sum has the variance of 2/3 of one, and that of the next is correlated by 1/4.
    """
    found = np.concatenate(triangles)
    if len(found) < 2:
        return np.zeros(found.shape[1]), 0
    centred = np.eye(len(found)) - 1.0 / len(found)
    alike = np.eye(len(found))
    first = np.cumsum([0, *(len(one) for one in triangles)])
    for start, end in pairwise(first.tolist()):
        beside = np.arange(start, end - 1)
        alike[beside, beside + 1] = alike[beside + 1, beside] = 0.25
    alike = centred @ alike @ centred
    trace = float(np.trace(alike))
    variance = 1.5 * periods * np.sum((centred @ found) ** 2, axis=0) / trace
    return variance, round(trace**2 / float(np.sum(alike**2)))


def _periods_since(start_s: float, step_s: float, period_s: float, points: IntArray) -> IntArray:
    """Return how many periods after that of the first point of a grid points of it lie, shape (n,)."""
    of = [np.floor((start_s + step_s * at) / period_s + 1e-9) for at in (points, np.zeros(1))]
    return np.asarray(of[0] - of[1], dtype=np.int64)


def spread_beyond_noise(found: PeriodSpread, noise: FloatArray) -> FloatArray:
    """Return what the spread over periods adds to the noise's covariance, in SI, (c, c): mostly nothing.

    Noise that changes from period to period (drift, temperature) hides from residuals within a period.
    """
    own, theirs = found.smooth, np.diag(noise)
    if not found.degrees:
        return np.zeros(noise.shape)
    limit = chi_square_beyond((1.0 - CONFIDENCE) / len(own), found.degrees) / found.degrees
    more = np.where(own > limit * theirs, np.maximum(own - theirs, 0.0), 0.0)
    return np.asarray(np.diag(more))


def period_advice(found: PeriodSpread, noise: FloatArray, columns: Sequence[str]) -> tuple[Advice, ...]:
    """Return the advice that names what varies from period to period by more than the noise within them.

    `noise` is the covariance that the residuals explain, in SI, shape (c, c), in the order of `columns`.
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


def _period_problems(record: Record, forces: Sequence[str], period_s: float) -> list[Problem]:
    """Return what is wrong with a declared period."""
    where = f"{record.name}: period_s"
    if not 2.0 < period_s * record.fs < np.inf:
        return [Problem(where, f"is {period_s!r}", "give the period in s, longer than two samples")]
    if record.duration_s < FEWEST_PERIODS * period_s * (1.0 - 1e-9):
        what = f"is {period_s:g} s, and {record.duration_s:g} s hold fewer than {FEWEST_PERIODS} periods"
        return [Problem(where, what, "record more periods, or do not declare one")]
    correlations = {key: lag_correlation(record, key, round(period_s * record.fs)) for key in forces}
    worst = min(correlations, key=lambda key: correlations[key], default=None)
    if worst is None or correlations[worst] >= LEAST_CORRELATION:
        return []
    own = found_period(record, forces)
    remedy = f"it repeats every {own:g} s" if own else "give the excitation's own period, or none"
    what = f"is {period_s:g} s, but {worst} does not repeat then (correlation {correlations[worst]:.2f})"
    return [Problem(where, what, remedy)]
