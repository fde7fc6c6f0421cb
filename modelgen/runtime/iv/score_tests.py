"""Which of the effects that a model lacks the residual of a fit with instruments shows, and what it moves.

The residual is regressed on what an effect does to the rows (`model_errors`), both made orthogonal to the
fit's regressors (Frisch and Waugh 1933; Rao 1948 for the test). Noise of the sensors is in the residual, but
not in the simulated effect: only what the effect explains remains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.effect import FORCES, Effect, Moved
from modelgen.runtime.iv.thresholds import (
    AT_A_TIME,
    CANCELLED,
    LARGEST_SHARE,
    LEAST_DRIFT,
    LEAST_EXPLAINED,
    LEAST_MOVE,
    LEAST_MOVED_SHARE,
    LEAST_OWN_DELAY,
    LEAST_OWN_SHARE,
    LEVEL,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, long_run
from modelgen.runtime.least_squares.spanned import Spanned
from modelgen.runtime.numerics.block_column import block_column
from modelgen.runtime.numerics.few_instants import USUAL
from modelgen.runtime.numerics.regressor import Regressors
from modelgen.runtime.numerics.tails import likely_square, normal_beyond
from modelgen.runtime.parameters.thresholds import BEYOND_CHANCE


@dataclass(frozen=True, eq=False)
class Score:
    """What a residual says of one effect.

    Attributes
    ----------
    effect : Effect
    size, std : float
        Its estimated size, in its unit, and the standard deviation of that; NaN where it is too small, or too
        large, to matter.
    explained : float
        Share of the residual's power.
    move : array, shape (c,)
        By how much X changes, in SI, when the effect is taken into account.
    own : float
        Share of the effect that lies outside of the columns.
    power : float
        Sum of squares of that part, weighted.
    least : float
        The size that would be certain.
    matters : bool
        Whether it is certain (1 % over all effects) and moves or explains enough.
    likely : bool
        Whether it would be certain if its deviation were known exactly.
    """

    effect: Effect
    size: float
    std: float
    explained: float
    move: FloatArray
    own: float
    power: float
    least: float
    matters: bool
    likely: bool = False


def scores(
    span: Span,
    effects: Sequence[Effect],
    grown: Sequence[Sequence[FloatArray]],
    least_own: float = LEAST_OWN_SHARE,
) -> tuple[Score, ...]:
    """Return the score of each effect that can be told from the columns, the most explained first.

    Parameters
    ----------
    span : Span
        Of a fit with instruments.
    effects : sequence of Effect
    grown : sequence of sequence of array
        For each effect how Y - W X grows per unit of its size: one array, shape (rows,), a block of the fit.
    least_own : float
        The share of an effect that is to lie outside of the regressors.
    """
    if not effects:
        return ()
    fit, slope, r, told = span.fit, span.slope, span.left, span.compared(grown, span.left)
    late = np.array([effect.kind == "delay" for effect in effects])
    apart = told.power > np.where(late, min(least_own, LEAST_OWN_DELAY), least_own) * told.whole
    # a force may be friction to all records but one, and have taken the weight of that
    forces = [effect.kind in FORCES for effect in effects]
    tried = zip(apart.tolist(), forces, grown, strict=True)
    seen = np.flatnonzero([one or (force and span.tells(column)) for one, force, column in tried])
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit, grown=False)), 0.0))
    critical = normal_beyond(0.5 * LEVEL / max(len(seen), 1))
    largest, every = span.largest_overlooked, float(r @ r)
    found = []
    for place in seen.tolist():
        power, whole = float(told.power[place]), float(told.whole[place])
        size = float(told.along[place]) / power
        explained, move = size**2 * power / every, -told.share[:, place] * size
        move = move if slope is None else slope @ move
        most = np.maximum(abs(move), effects[place].varied(fit.columns, fit.solution.x, size))
        large = explained > LEAST_EXPLAINED or bool(np.any(most > LEAST_MOVE * spread))
        # sampling and filters are not exact beyond that
        large = large and bool(np.any(most > LEAST_MOVED_SHARE * np.abs(fit.solution.x)))
        std = rarely = least = np.nan
        if large and abs(size) * float(np.sqrt(whole)) < largest:
            own = span.apart(stacked(fit, grown[place]))
            std, rarely = _deviations(fit, r, own, size, power, (USUAL, critical))
            least = critical * std
        if likely := abs(size) > least:
            least = critical * rarely
        matters = abs(size) > least
        one = Score(effects[place], size, std, explained, move, power / whole, power, least, matters, likely)
        found.append(one)
    return tuple(sorted(found, key=lambda one: -one.explained))


def moves_within(
    span: Span,
    grown: Sequence[Sequence[FloatArray]],
    doubtful: bool = False,
    own: float = LEAST_OWN_SHARE,
    most: float = inf,
) -> FloatArray:
    """Return what effects move whose sizes are known to be about 1 at most, as a mean square, shape (c, c).

    They are not estimated, but what the residual says of a size counts (`likely_square`). What moves nothing
    by more than rounding is left out: the instants at which it acts are not used. `grown` is as in `scores`,
    `own` as `least_own` there, and `doubtful` tells whether effects are as likely not there at all. With
    `most` a size lies between zero and that: where the residual says otherwise it is of something else.
    """
    fit, slope = span.fit, span.slope
    total = np.zeros((len(fit.columns),) * 2)
    seen = [column for column in grown if any(part.any() for part in column)]
    told = span.compared(seen, span.left)
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit, grown=False)), 0.0))
    for place, column in enumerate(seen):
        std, power = inf, float(told.power[place])
        size = float(told.along[place]) / power if power > 0.0 else 0.0
        if power > own * float(told.whole[place]):
            (std,) = _deviations(fit, span.left, span.apart(stacked(fit, column)), size, power, (USUAL,))
        plain = told.share[:, place] if slope is None else slope @ told.share[:, place]
        move = plain if span.moved is None else span.moved(column)[: len(fit.columns)]
        elsewhere = most < inf and max(size - most, -size) > BEYOND_CHANCE * std
        if elsewhere or np.all(np.abs(move) <= LEAST_DRIFT * spread):
            continue
        total += min(likely_square(size, std, doubtful), most**2) * np.outer(move, move)
    return total


@dataclass(frozen=True, eq=False)
class Compared:
    """Effects against regressors and a residual.

    Attributes
    ----------
    whole, power : array, shape (effects,)
        Sums of squares of each effect, and of its part outside of the regressors.
    along : array, shape (effects,)
        Its product with the residual.
    share : array, shape (parameters, effects)
        Parameters that regression of the effect gives.
    """

    whole: FloatArray
    power: FloatArray
    along: FloatArray
    share: FloatArray


class Span:
    """What the weighted regressors of a fit span, with columns for what is estimated already.

    Weighted columns and residuals are in SI times the weights.
    """

    def __init__(
        self,
        fit: Fit,
        others: Sequence[Sequence[FloatArray]] = (),
        slope: FloatArray | None = None,
        moved: Moved | None = None,
    ) -> None:
        """Take a fit, and how Y - W X grows with what is estimated already (delays, effects).

        Parameters
        ----------
        fit : Fit
        others : sequence of sequence of array
            One array a block of the fit for each.
        slope : array, shape (c, p), optional
            How X grows with the p parameters that were fitted in its place.
        moved : callable, optional
            Where the weights of the fit are others; `fit.white` has its own.
        """
        self.moved = fit.white.moved if moved is None and fit.white is not None else moved
        R = fit.regressors if slope is None else fit.regressors.mixed(slope)
        self.fit, self.slope, free = fit, slope, R.columns
        self._spanned = Spanned(R.joined(others).weighted(fit.weights))
        self._back, self.made = self._spanned.back[:free], R.made
        # the norm of what an effect may add to the rows
        x = fit.solution.x if free == len(fit.columns) else _unknowns(fit, R)
        self.largest_overlooked = LARGEST_SHARE * float(np.max(self._spanned.sizes[:free] * np.abs(x)))

    @cached_property
    def left(self) -> FloatArray:
        """The fit's weighted residual without what the regressors explain of it, shape (r,)."""
        return self.apart(self.fit.weighted_residual)

    def apart(self, column: FloatArray) -> FloatArray:
        """Return a weighted column, shape (r,), without what the regressors explain of it."""
        return self._spanned.apart(column)

    def tells(self, column: Sequence[FloatArray]) -> bool:
        """Tell whether an effect, one array a block, shape (n,), is apart from the columns at equal weights.

        Blocks of one row have that of the largest: what the effect leaves in one record may have taken its
        weight, and to the others it may be a column.
        """
        parts = [weight * part for weight, part in zip(self.fit.weights, column, strict=True)]
        own = np.split(self.apart(np.concatenate(parts)), np.cumsum([len(part) for part in parts])[:-1])
        left, whole = (
            sum(more * (one @ one) for more, one in zip(self._larger, every, strict=True))
            for every in (own, parts)
        )
        return bool(left > LEAST_OWN_SHARE * whole)

    @cached_property
    def _larger(self) -> list[float]:
        """By how much the square of each block's weight grows to that of the largest of its row."""
        most: dict[int, float] = {}
        pairs = list(zip(self.fit.blocks, self.fit.weights, strict=True))
        for block, weight in pairs:
            most[block.row] = max(most.get(block.row, 0.0), weight)
        return [(most[block.row] / weight) ** 2 for block, weight in pairs]

    def compared(self, grown: Sequence[Sequence[FloatArray]], residual: FloatArray) -> Compared:
        """Compare effects, one array a block, with the regressors, and a residual apart from these, (r,)."""
        count, lefts = len(grown), self._spanned.parts(residual)
        whole, power, along = np.zeros(count), np.zeros(count), np.zeros(count)
        share = np.empty((len(self._back), count))
        for start in range(0, count, AT_A_TIME):
            now = slice(start, start + AT_A_TIME)
            across = np.zeros((self._spanned.width, len(grown[now])))
            for place, column in enumerate(grown[now]):
                for index, rows in block_column(column).parts.items():  # most effects are seen in few rows
                    part = self.fit.weights[index] * rows
                    across[:, place] += self._spanned.across(index, part)
                    whole[start + place] += part @ part
                    along[start + place] += part @ lefts[index]
            inner = self._spanned.coordinates(across)
            power[now] = whole[now] - np.sum(inner**2, axis=0)
            share[:, now] = self._back @ inner
        for place in np.flatnonzero(power < CANCELLED * whole).tolist():
            # twice: rounding leaves as much of the regressors as is to be found
            own = self.apart(self.apart(stacked(self.fit, grown[place])))
            power[place], along[place] = own @ own, own @ residual
        return Compared(whole, power, along, share)


def _unknowns(fit: Fit, R: Regressors) -> FloatArray:
    """Return the parameters that belong to the columns of R."""
    weighted = np.concatenate(R.weighted(fit.weights).dense().samples)
    return np.asarray(np.linalg.lstsq(weighted, fit.weighted_measurement, rcond=None)[0])


def stacked(fit: Fit, parts: Sequence[FloatArray]) -> FloatArray:
    """Return parts of the blocks of a fit, in SI, in one, weighted, shape (r,)."""
    return np.concatenate([w * part for w, part in zip(fit.weights, parts, strict=True)])


def _deviations(
    fit: Fit, r: FloatArray, own: FloatArray, size: float, power: float, quantiles: Sequence[float]
) -> list[float]:
    """Return the standard deviation of an effect's size, of residuals without the effect, for each quantile.

    It is such that this normal quantile holds where few instants tell it.
    """
    change = np.split(own * (r - own * size) / power, np.cumsum([len(block.place) for block in fit.blocks]))
    series: list[FloatArray] = []
    for indices in fit.by_record.values():
        place = np.concatenate([fit.blocks[index].place for index in indices])
        psi = np.concatenate([change[index] for index in indices])
        series.append(np.bincount(place, psi, fit.blocks[indices[0]].grid).astype(float)[:, None])
    variances = long_run(series, quantiles, grown=False).covariances
    return [float(np.sqrt(max(one[0, 0], 0.0))) for one in variances]
