"""Is an inertia the same all over the records? A Wald test on its column, with factors that change slowly.

One axis of a machine of several carries what the others move: its inertia changes with their posture, and
with its own. A chain holds one number for it. The column of the inertia times slow functions of the place in
the records (cosines), or of the body's angle (cosine and sine), shows whether that number is a mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray, IntArray
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
from modelgen.runtime.rows.row_block import STRETCH

# factors of the samples of a block, its index and their places on the grid -> shape (k, n)
Factors = Callable[[int, IntArray], FloatArray]

OVER_RECORDS = "over the records"
# Of so many bodies the angles of a stretch are kept, for its other rows.
ANGLES_KEPT = 8


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
    if model.is_arm or model.by_power or not exceeding_noise(model, records, choice, fit, LARGEST_NOISE):
        return None
    ways = list(_ways(fit, model, records, choice))
    found = [one.tested(sums) for one, sums in zip(ways, _all_sums(fit, ways), strict=True)]
    certain = [one for one in found if one is not None]
    return max(certain, key=lambda one: one.explained, default=None)


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


def _ways(fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice) -> Iterator[_Changing]:
    """Yield every inertia with what it may change with, in words, and factors of its column."""
    starts = np.cumsum([0, *(record.n * record.dt for record in records)])

    def sample(index: int, place: IntArray) -> IntArray:
        block = fit.blocks[index]
        record, factor = records[block.record], choice.decimation[block.record]
        # the filter's reach is left out at both ends alike
        first = max(record.n - 1 - (block.grid - 1) * factor, 0) // 2
        return np.minimum(first + factor * place, record.n - 1)

    def over_records(index: int, place: IntArray) -> FloatArray:
        record = fit.blocks[index].record
        share = (starts[record] + sample(index, place) * records[record].dt) / starts[-1]
        # cosines of multiples of an angle, as Chebyshev's polynomials follow from each other
        found = [np.ones_like(share), np.cos(np.pi * share)]
        while len(found) <= SLOW_CHANGES:
            found.append(2.0 * found[1] * found[-1] - found[-2])
        return np.array(found[1:])

    @lru_cache(maxsize=ANGLES_KEPT)
    def turned(key: str, record: int, first: int, factor: int, count: int) -> FloatArray:
        at = np.minimum(first + factor * np.arange(count), records[record].n - 1)
        q = records[record].read(key, first, int(at[-1]) + 1)[at - first]
        return np.array([np.cos(q), np.sin(q)])

    def with_angle(key: str, index: int, place: IntArray) -> FloatArray:
        if not place.size:
            return np.zeros((2, 0))
        record, begin = fit.blocks[index].record, int(place[0])
        first, count = int(sample(index, place[:1])[0]), int(place[-1]) - begin + 1
        found = turned(key, record, first, choice.decimation[record], count)
        return found if count == place.size else found[:, place - begin]

    for column, name in enumerate(fit.columns):
        if name not in model.roles or model.roles[name].role != "inertia":
            continue
        yield _Changing(fit, column, OVER_RECORDS, over_records)
        body = model.roles[name].bodies[0]
        keys = [one.key for one in model.sensors if one.body == body and one.measures == "position"]
        if keys and model.units[name] == "kg m^2":
            yield _Changing(fit, column, f"with the angle of {body}", partial(with_angle, keys[0]))


class _Sums(NamedTuple):
    """What one walk over all rows gives.

    Attributes
    ----------
    crossed : array, shape (c, k)
        Products of the fit's columns with the factors' columns.
    power, along : array, shape (k, k) and (k,)
        Products of these with each other, and with the residual.
    residual : array, shape (c,)
        Products of the fit's columns with the residual.
    squares : array, shape (k, k)
        The factors' mean square.
    """

    crossed: FloatArray
    power: FloatArray
    along: FloatArray
    residual: FloatArray
    squares: FloatArray


def _all_sums(fit: Fit, ways: Sequence[_Changing]) -> list[_Sums]:
    """Return the sums of all inertias with their factors; several have the same factors."""
    found = [_Sums(*(np.zeros(()) for _ in _Sums._fields)) for _ in ways]
    # all rows of a stretch one after the other: most have the same factors
    for index, start in _pieces(fit):
        square = fit.weights[index] ** 2
        part, R, e = fit.between(index, start, start + STRETCH)
        left, made = R.across(e), dict[Factors, FloatArray]()
        for place, one in enumerate(ways):
            if one.factors not in made:
                made[one.factors] = one.factors(index, part.place)
            factors = made[one.factors]
            added = R.chosen(np.array([one.column])).T * factors
            more = (R.across(added.T), added @ added.T, added @ e, left)
            weighted = [square * product for product in more]
            steps = (*weighted, factors @ factors.T / fit.count)
            found[place] = _Sums(*(a + b for a, b in zip(found[place], steps, strict=True)))
    return found


def _pieces(fit: Fit) -> Iterator[tuple[int, int]]:
    """Yield the blocks of each record, stretch by stretch: which one, and the first point of its grid."""
    for indices in fit.by_record.values():
        for start in range(0, fit.blocks[indices[0]].grid, STRETCH):
            for index in indices:
                yield index, start


@dataclass(frozen=True, eq=False)
class _Changing:
    """The weighted column of an inertia times factors, shape (n, k), stretch by stretch."""

    fit: Fit
    column: int
    along: str
    factors: Factors

    def tested(self, sums: _Sums) -> ChangingInertia | None:
        """Return the change of the inertia by the factors if it is certain and large."""
        fit, inverse = self.fit, self.fit.solution.inverse
        shares = inverse @ sums.crossed
        power = sums.power - shares.T @ sums.crossed
        along = sums.along - shares.T @ sums.residual
        if np.linalg.cond(power) > 1.0 / np.finfo(float).eps:
            return None
        sizes = np.asarray(np.linalg.solve(power, along), dtype=float)
        explained = float(sizes @ along) / fit.residual_norm**2
        share = float(np.sqrt(sizes @ sums.squares @ sizes)) / abs(fit.solution.x[self.column])
        if explained < CHANGES_EXPLAINED or share < LEAST_CHANGE_OF_INERTIA:
            return None
        series = [
            partial(self.influence, shares, power, sizes, indices) for indices in fit.by_record.values()
        ]
        spread = long_run_covariance(series)
        statistic = float(sizes @ np.linalg.lstsq(spread, sizes, rcond=None)[0])
        if chi_square_tail(statistic, len(sizes)) > CHANGES_LEVEL:
            return None
        return ChangingInertia(fit.columns[self.column], self.along, share, explained, -shares @ sizes)

    def own(
        self, shares: FloatArray, index: int, start: int, stop: int
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return the places of a stretch of a block, what is not of the fit's columns, and the residual."""
        part, R, e = self.fit.between(index, start, stop)
        added = R.chosen(np.array([self.column])) * self.factors(index, part.place).T
        w = self.fit.weights[index]
        return part.place, w * (added - R.times(shares)), w * e

    def influence(
        self, shares: FloatArray, power: FloatArray, sizes: FloatArray, indices: Sequence[int]
    ) -> Iterator[FloatArray]:
        """Yield what the instants of a record, whose blocks these are, contribute to the factors' sizes."""
        grid = self.fit.blocks[indices[0]].grid
        for start in range(0, grid, STRETCH):
            stop = min(start + STRETCH, grid)
            psi = np.zeros((stop - start, len(sizes)))
            for index in indices:
                place, own, e = self.own(shares, index, start, stop)
                psi[place - start] += own * (e - own @ sizes)[:, None]
            yield np.asarray(np.linalg.solve(power, psi.T).T)
