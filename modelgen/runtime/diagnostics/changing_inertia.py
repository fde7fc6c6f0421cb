"""Is an inertia the same all over the records? A Wald test on its column, with factors that change slowly.

One axis of a machine of several carries what the others move: its inertia changes with their posture, and
with its own. A chain holds one number for it. The column of the inertia times slow functions of the place in
the records (cosines), or of the body's angle (cosine and sine), shows whether that number is a mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.diagnostics.thresholds import (
    CHANGES_EXPLAINED,
    CHANGES_LEVEL,
    LARGEST_NOISE,
    LEAST_CHANGE_OF_INERTIA,
    SLOW_CHANGES,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import chi_square_tail
from modelgen.runtime.records.record import Record

OVER_RECORDS = "over the records"


@dataclass(frozen=True, eq=False)
class ChangingInertia:
    """An inertia that is not the same all over the records.

    Attributes
    ----------
    name : str
        The column.
    along : str
        What it changes with, in words.
    share : float
        By how much, rms, as a share of the number that was found.
    explained : float
        Share of the residual's power.
    move : array, shape (c,)
        By how much X changes when it may.
    """

    name: str
    along: str
    share: float
    explained: float
    move: FloatArray


def changing_inertia(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice
) -> ChangingInertia | None:
    """Return the inertia whose change explains most of a residual that is more than noise; None without any.

    Where it changes fast against the filter, products behind the filter are not those in front of it, and the
    test sees less.
    """
    if model.is_arm or model.by_power or not all(block.in_memory for block in fit.blocks):
        return None
    if not exceeding_noise(model, records, choice, fit, LARGEST_NOISE):
        return None
    found = [
        one
        for column, name in enumerate(fit.columns)
        if name in model.roles and model.roles[name].role == "inertia"
        for along, factors in _factors(fit, model, records, choice, name)
        if (one := _tested(fit, column, along, factors)) is not None
    ]
    return max(found, key=lambda one: one.explained, default=None)


def changing_inertia_advice(found: ChangingInertia | None) -> tuple[Advice, ...]:
    """Return what is said of it."""
    if found is None:
        return ()
    what = (
        f"changes {found.along} (by {100.0 * found.share:.2g} % rms), as with the posture of a machine with "
        "several axes: its number is a mean over the postures, and the intervals hold what that moves"
    )
    return (
        Advice("more than the model", found.name, what, "describe the machine as an arm, or keep a posture"),
    )


def _factors(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice, name: str
) -> Iterator[tuple[str, list[FloatArray]]]:
    """Yield what an inertia may change with, in words, and factors of its column, (n, k) a block each."""
    starts = np.cumsum([0, *(record.n * record.dt for record in records)])
    times = []
    for block in fit.blocks:
        record, factor = records[block.record], choice.decimation[block.record]
        # the filter's reach is left out at both ends alike
        first = max(record.n - 1 - (block.grid - 1) * factor, 0) // 2
        times.append(np.minimum(first + factor * block.place, record.n - 1))
    k = np.arange(1, SLOW_CHANGES + 1)
    places = [
        (starts[block.record] + at * records[block.record].dt) / starts[-1]
        for block, at in zip(fit.blocks, times, strict=True)
    ]
    yield OVER_RECORDS, [np.cos(np.pi * np.outer(place, k)) for place in places]
    body = model.roles[name].bodies[0]
    keys = [one.key for one in model.sensors if one.body == body and one.measures == "position"]
    if not keys or model.units[name] != "kg m^2":
        return
    angles = [records[block.record].signals[keys[0]][at] for block, at in zip(fit.blocks, times, strict=True)]
    yield f"with the angle of {body}", [np.column_stack([np.cos(q), np.sin(q)]) for q in angles]


def _tested(fit: Fit, column: int, along: str, factors: Sequence[FloatArray]) -> ChangingInertia | None:
    """Return the change of an inertia by factors, shape (n, k) a block each, if it is certain and large."""
    R, at = fit.regressors.weighted(fit.weights), np.array([column])
    added = [one.chosen(at) * part for one, part in zip(R, factors, strict=True)]
    across = [one.across(more) for one, more in zip(R, added, strict=True)]
    shares = fit.solution.inverse @ np.sum(across, axis=0)
    own = np.concatenate([more - one.times(shares) for one, more in zip(R, added, strict=True)])
    e = fit.weighted_residual
    power, along_residual = own.T @ own, own.T @ e
    if np.linalg.cond(power) > 1.0 / np.finfo(float).eps:
        return None
    sizes = np.linalg.solve(power, along_residual)
    explained = float(sizes @ along_residual) / float(e @ e)
    value = fit.solution.x[column]
    share = float(np.sqrt(np.mean((np.concatenate(factors) @ sizes) ** 2))) / abs(value)
    if explained < CHANGES_EXPLAINED or share < LEAST_CHANGE_OF_INERTIA:
        return None
    psi = np.linalg.solve(power, (own * (e - own @ sizes)[:, None]).T).T
    series: dict[int, FloatArray] = {}
    last = 0
    for block in fit.blocks:
        first, last = last, last + len(block.place)
        series.setdefault(block.record, np.zeros((block.grid, len(sizes))))[block.place] += psi[first:last]
    spread = long_run_covariance(list(series.values()))
    statistic = float(sizes @ np.linalg.lstsq(spread, sizes, rcond=None)[0])
    if chi_square_tail(statistic, len(sizes)) > CHANGES_LEVEL:
        return None
    return ChangingInertia(fit.columns[column], along, share, explained, -shares @ sizes)
