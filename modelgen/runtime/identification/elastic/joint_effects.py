"""What rows of an elastic arm show of errors of its channels, estimated together with the parameters."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.channel_errors import (
    SetRight,
    resolved,
    runs_away,
)
from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.identification.thresholds import (
    ALIKE_PART,
    LARGE_PART,
    LEAST_ALIGNED_SHARE,
    MORE_CERTAIN,
)
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.score_tests import Score, Span, scores
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class JointEffects:
    """A fit of base parameters and of further sizes of effects, which are its last columns.

    `pull`, shape (c,), is what noise of the sensors adds to the products of its columns with Y - W X.
    """

    fit: Fit
    effects: tuple[Effect, ...]
    pull: FloatArray

    def step(self, effect: Effect) -> tuple[float, float]:
        """Return the further size of an effect, and its standard deviation, with what noise pulls it by."""
        place = self.fit.columns.index(effect.name)
        return float(self.fit.solution.x[place]), float(np.hypot(self._spread[place], self._pulled(place)))

    @cached_property
    def _covariance(self) -> FloatArray:
        return np.asarray(hac_covariance(self.fit))

    @cached_property
    def _spread(self) -> FloatArray:
        return np.asarray(np.sqrt(np.maximum(np.diag(self._covariance), 0.0)))

    def _pulled(self, place: int) -> float:
        """Return by how much noise in the other columns moves the size in a column."""
        R = self.fit.triangle[:-1, :-1]
        other = np.arange(len(R)) != place
        share = np.asarray(np.linalg.lstsq(R[:, other], R[:, place], rcond=None)[0], dtype=np.float64)
        return pulled_size(share, self.pull[other], R[:, place] - R[:, other] @ share)

    def told(self, known: Mapping[Effect, float]) -> SetRight:
        """Return what is known of the effects."""
        last = [self.fit.columns.index(effect.name) for effect in known]
        own = [place for place in range(len(self.fit.columns)) if place not in last]
        R = self.fit.triangle[:-1, :-1]
        moves = np.asarray(-np.linalg.lstsq(R[:, own], R[:, last], rcond=None)[0], dtype=np.float64)
        pulled = np.array([self._pulled(place) for place in last])
        covariance = self._covariance[np.ix_(last, last)] + np.outer(pulled, pulled)
        columns = tuple(self.fit.columns[place] for place in own)
        return SetRight(columns, tuple(known), tuple(known.values()), moves, covariance)


def pulled_size(share: FloatArray, pull: FloatArray, own: FloatArray) -> float:
    """Return by how much noise moves the size of an effect beside columns.

    Parameters
    ----------
    share : array, shape (c,)
        Parameters that regression of the effect on the columns gives.
    pull : array, shape (c,)
        What noise adds to the products of the columns with Y - W X.
    own : array, shape (r,)
        What that regression leaves of the effect.
    """
    power = float(own @ own)
    return -float(share @ pull) / power if power > 0.0 else 0.0


def joint_effects(rows: EffectRows, known: Sequence[Effect], rests: bool) -> JointEffects:
    """Return the fit with the effects that are known, and those that rows show besides, one by one.

    What is large bends the rows, so that small ones seem to be off as well: while steps do not rest only what
    explains a large share of what is left is taken up.
    """
    chosen, model = [*known], rows.job.model
    forces = {actuator.key for actuator in model.actuators}
    while True:
        fit = rows.solved(chosen)
        least = 0.0 if rests and (known or not chosen) else LARGE_PART
        told = [one for one in _shown(rows, fit, chosen) if one.explained > least]
        # one channel tells the time of all others
        late = sum(effect.kind == "delay" for effect in chosen) + 1 == len(model.channels)
        told = [one for one in told if not (late and one.effect.kind == "delay")]
        if not told:
            return JointEffects(fit, tuple(chosen), rows.pull(fit))
        chosen.append(_first(told, forces))


def _first(told: Sequence[Score], forces: Container[str]) -> Effect:
    """Return what explains most; of what explains as much, that a force is late."""
    equal = [one.effect for one in told if one.explained > ALIKE_PART * told[0].explained]
    late = [effect for effect in equal if effect.kind == "delay" and effect.channel in forces]
    return (*late, *equal)[0]


def _shown(rows: EffectRows, fit: Fit, chosen: Sequence[Effect]) -> Iterator[Score]:
    """Yield what is certain and matters of what a fit leaves, what explains most first."""
    rest, pull = [effect for effect in rows.effects if effect not in chosen], rows.pull(fit)
    for one in scores(Span(fit), rest, rows.grown(fit, rest), LEAST_ALIGNED_SHARE):
        if one.matters and one.effect.possible(one.size) and _within(one, rows.job.records):
            pulled = abs(float(one.move @ pull) / (one.size * one.power))
            if abs(one.size) - pulled > MORE_CERTAIN * one.least:
                yield one


def _within(score: Score, records: Sequence[Record]) -> bool:
    """Tell whether a size is more than channels resolve, and no more than a mistake makes."""
    effect, size = score.effect, score.size
    return resolved(effect, size, records) and not runs_away(effect, size, records)
