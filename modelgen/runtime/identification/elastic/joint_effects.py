"""What rows of an elastic arm show of errors of its channels, estimated together with the parameters."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.channel_errors import (
    Instead,
    SetRight,
    by_half,
    forces_of_drives,
    resolved,
    runs_away,
)
from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.identification.elastic.encoder_zeros import EncoderZero
from modelgen.runtime.identification.elastic.force_gains import ForceGain, all_but_one, common_scale
from modelgen.runtime.identification.elastic.force_lags import is_lag, lag_of_delay
from modelgen.runtime.identification.elastic.row_forces import RowForce
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    ALIGNED_APART,
    ALIKE_PART,
    AS_CERTAIN,
    HALF_SAMPLE,
    LARGE_PART,
    LEAST_ALIGNED_SHARE,
    LEFT_BIAS,
    MORE_CERTAIN,
    SAME_PART,
    TOLD_APART,
)
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import delay_effect
from modelgen.runtime.iv.score_tests import Score, Span, scores, stacked
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.numerics.tails import likely_square
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class JointEffects:
    """A fit of base parameters and of further sizes of effects, which are its last columns.

    It is one of `rows`.
    """

    fit: Fit
    effects: tuple[Effect, ...]
    rows: EffectRows

    @cached_property
    def pull(self) -> FloatArray:
        """What noise of the sensors adds to the products of the columns with Y - W X, (c,) in SI."""
        return self.rows.pull(self.fit, self.fit.columns)

    def step(self, effect: Effect) -> tuple[float, float]:
        """Return the further size of an effect, and its standard deviation, with what noise pulls it by."""
        place = self.fit.columns.index(effect.name)
        size, pulled = float(self.fit.solution.x[place]), self._pulled(place)
        if is_lag(effect):
            size, pulled = size - pulled, LEFT_BIAS * pulled
        return size, float(np.hypot(self._spread[place], pulled))

    def shows(self, effect: Effect) -> bool:
        """Tell whether the further size of an effect, less what noise pulls it by, is certain."""
        place = self.fit.columns.index(effect.name)
        size = float(self.fit.solution.x[place]) - self._pulled(place)
        return abs(size) > ALIGNED_APART * float(self._spread[place])

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
        own = R[:, place] - R[:, other] @ share
        return pulled_size(share, self.pull[other], own, float(self.pull[place]))

    def told(self, known: Mapping[Effect, float], held: bool = False) -> SetRight:
        """Return what is known of the effects, of forces that are taken as `held` commands or not."""
        last = [self.fit.columns.index(effect.name) for effect in known]
        own = [place for place in range(len(self.fit.columns)) if place not in last]
        R = self.fit.triangle[:-1, :-1]
        moves = np.asarray(-np.linalg.lstsq(R[:, own], R[:, last], rcond=None)[0], dtype=np.float64)
        pulled = np.array([self._pulled(place) for place in last])
        covariance = self._covariance[np.ix_(last, last)] + np.outer(pulled, pulled)
        columns = tuple(self.fit.columns[place] for place in own)
        spread = np.sqrt(np.diag(covariance)).tolist()
        records = self.rows.job.records
        unsaid = tuple(
            one
            for (one, size), std in zip(known.items(), spread, strict=True)
            if isinstance(one, EncoderZero)
            and (abs(size) < ALIGNED_APART * std or not resolved(one, size, records))
        )
        # zeros are there whatever else is: nothing stands in their place
        others = tuple(
            ()
            if isinstance(one, EncoderZero)
            else (*self._others(one, known), *self._lag_of(one, known, held))
            for one in known
        )
        found = SetRight(columns, tuple(known), tuple(known.values()), moves, covariance, (), others, unsaid)
        shared = self._covariance[np.ix_(own, last)] - moves @ self._covariance[np.ix_(last, last)]
        beyond = tuple(common_scale(self.rows, known))
        return replace(found, beyond=beyond, shared=shared, samples=self.fit.count)

    def _lag_of(self, late: Effect, known: Mapping[Effect, float], held: bool) -> Iterator[Instead]:
        """Yield that a delay of a force is that of a lag, with what that moves as likely as it is.

        Which of the two it is shows at high frequencies only; a lag is as likely as none beforehand, and may
        be a part of the delay.
        """
        rest = [one for one in self.rows.effects if one not in known]
        sample = 1.0 / self.rows.job.records[0].fs if held else 0.0
        found = lag_of_delay(late, known[late], rest, sample)
        if found is None:
            return
        lag, size = found
        joint = JointEffects(self.rows.solved([*known, lag]), (*known, lag), self.rows)
        if lag.name not in joint.fit.columns:
            return
        step, std = joint.step(lag)
        share = float(np.sqrt(likely_square(step / size, std / size)))
        R, last = joint.fit.triangle[:-1, :-1], joint.fit.columns.index(lag.name)
        own = [place for place in range(len(R)) if place != last]
        move = np.linalg.lstsq(R[:, own], R[:, last], rcond=None)[0] * (-share * size)
        yield Instead(lag, size, dict(zip((joint.fit.columns[k] for k in own), move.tolist(), strict=True)))

    def _others(self, effect: Effect, known: Mapping[Effect, float]) -> tuple[Instead, ...]:
        """Return what explains the rows as well as an effect does, in its place."""
        fit = self.rows.solved([one for one in known if one is not effect])
        span = Span(fit)
        rest = [one for one in self.rows.every if one not in known and one.words != effect.words]
        grown = self.rows.grown(fit, [effect, *rest])
        # channels are set right already, forces are still in the rows
        absorbed = 0.0 if isinstance(effect, RowForce) else known[effect]
        left = span.left + absorbed * span.apart(stacked(fit, grown[0]))
        told = span.compared(grown, left)
        size = told.along / np.maximum(told.power, np.finfo(float).tiny)
        # shares of what the effect explains, and how certain it is of what the others leave
        share = size**2 * told.power / (size[0] ** 2 * told.power[0])
        share[told.power <= LEAST_ALIGNED_SHARE * told.whole] = 0.0
        std = self.step(effect)[1]
        apart = np.abs(size[0]) * np.sqrt(np.maximum(1.0 - share, 0.0))
        found = []
        for place in np.flatnonzero((share > ALIKE_PART) & (apart < AS_CERTAIN * std)).tolist()[1:]:
            one, own = rest[place - 1], float(size[place])
            if one.possible(own) and _within(one, own, self.rows.job.records):
                move = told.share[:, 0] * size[0] - told.share[:, place] * own
                found.append(Instead(one, own, dict(zip(fit.columns, move.tolist(), strict=True))))
        return tuple(found)


def pulled_size(share: FloatArray, pull: FloatArray, own: FloatArray, along: float = 0.0) -> float:
    """Return by how much noise moves the size of an effect beside columns.

    Parameters
    ----------
    share : array, shape (c,)
        Parameters that regression of the effect on the columns gives.
    pull : array, shape (c,)
        What noise adds to the products of the columns with Y - W X.
    own : array, shape (r,)
        What that regression leaves of the effect.
    along : float
        What noise adds to the product of the effect with Y - W X.
    """
    power = float(own @ own)
    return (along - float(share @ pull)) / power if power > 0.0 else 0.0


def joint_effects(rows: EffectRows, known: Sequence[Effect], rests: bool) -> JointEffects:
    """Return the fit with the effects that are known, and those that rows show besides, one by one.

    What is large bends the rows, so that small ones seem to be off as well: while steps do not rest only what
    explains a large share of what is left is taken up. Rows without a force weigh less than their residual
    asks for: what explains others by letting these leave more is less likely, and is not looked for again.
    """
    chosen, model = [*known], rows.job.model
    forces = {actuator.key for actuator in model.actuators}
    begun = not all(isinstance(one, EncoderZero) for one in known)
    fit = rows.solved(chosen)
    while True:
        # a record of which rows use nothing has no zero
        chosen = [one for one in chosen if one.name in fit.columns]
        least = 0.0 if rests and (begun or len(chosen) <= len(known)) else LARGE_PART
        told = [one for one in _shown(rows, fit, chosen) if one.explained > least]
        # one channel tells the time of all others
        late = sum(effect.kind == "delay" for effect in chosen) + 1 == len(model.channels)
        told = [one for one in told if not (late and one.effect.kind == "delay")]
        if all_but_one(chosen, model):
            told = [one for one in told if not isinstance(one.effect, ForceGain)]
        first = _first(told, forces) if told else _likelier_gain(rows, fit, chosen) if rests else None
        if first is None:
            return JointEffects(fit, tuple(chosen), rows)
        tried = rows.solved([*chosen, first])
        if tried.misfit > fit.misfit:
            rows = rows.without(first)
            continue
        chosen, fit = [*chosen, first], tried
        if told and told[0].explained > LARGE_PART:
            # what it hid from least squares, as a spring, is in its column
            rows = rows.about(fit)
            fit = rows.solved(chosen)


def _likelier_gain(rows: EffectRows, fit: Fit, chosen: Sequence[Effect]) -> Effect | None:
    """Return the gain of a force with which rows are most likely, if clearly more so than without; or None.

    In rows of a wide band noise of accelerations is as much of a link as what tells a gain: what it explains
    is not certain then, but rows leave much less with it, and noise does less than that. Weights that are not
    those of the noise leave more alone, too.
    """
    least, best = fit.misfit - TOLD_APART, None
    gains = [one for one in rows.effects if isinstance(one, ForceGain) and one not in chosen]
    for one in gains if not all_but_one(chosen, rows.job.model) else ():
        tried = rows.solved([*chosen, one])
        if tried.misfit < least and one.name in tried.columns:
            joint = JointEffects(tried, (*chosen, one), rows)
            if joint.shows(one) and _within(one, joint.step(one)[0], rows.job.records):
                least, best = tried.misfit, one
    return best


def _first(told: Sequence[Score], forces: Container[str]) -> Effect:
    """Return what explains most; of what explains as much, that a force is late.

    Where a spring is always loaded one way its play is the zero of an encoder, which can be set right.
    """
    same = [one for one in told if one.explained > SAME_PART * told[0].explained]
    told = [*(one for one in same if not isinstance(one.effect, RowForce)), *told]
    equal = [one.effect for one in told if one.explained > ALIKE_PART * told[0].explained]
    late = [effect for effect in equal if effect.kind == "delay" and effect.channel in forces]
    return (*late, *equal)[0]


def _shown(rows: EffectRows, fit: Fit, chosen: Sequence[Effect]) -> Iterator[Score]:
    """Yield what is certain and matters of what a fit leaves, what explains most first."""
    rest, pull = [effect for effect in rows.effects if effect not in chosen], rows.pull(fit, fit.columns)
    along = dict(zip(rest, rows.pull(fit, [effect.name for effect in rest]).tolist(), strict=True))
    for one in scores(Span(fit), rest, rows.grown(fit, rest), LEAST_ALIGNED_SHARE):
        if one.matters and one.effect.possible(one.size) and _within(one.effect, one.size, rows.job.records):
            pulled = (float(one.move @ pull) / one.size + along[one.effect]) / one.power
            size = one.size - pulled if is_lag(one.effect) else one.size
            doubt = LEFT_BIAS * abs(pulled) if is_lag(one.effect) else abs(pulled)
            if abs(size) - doubt > MORE_CERTAIN * one.least and one.effect.possible(size):
                yield one


def _within(effect: Effect, size: float, records: Sequence[Record]) -> bool:
    """Tell whether a size is more than channels resolve, and no more than a mistake makes."""
    return resolved(effect, size, records) and not runs_away(effect, size, records)


@dataclass(frozen=True, eq=False)
class Aligned:
    """Where steps came to rest: the task with records set right, by what, and what rows leave."""

    task: Task
    known: dict[Effect, float]
    right: SetRight
    misfit: float

    @property
    def commands(self) -> tuple[Effect, ...]:
        """Delays by which forces are early by half a sample: their own, or one of all other channels."""
        own = tuple(one for one, size in self.known.items() if by_half(one, size, self.task.records))
        drives = forces_of_drives(self.task.model)
        read = set(self.task.model.channels).difference(drives)
        late = {one: size for one, size in self.known.items() if one.kind == "delay" and one.channel in read}
        if own or not drives or len(late) < len(read):
            return own
        force, sizes = delay_effect(drives[0]), tuple(late.values())
        alike = (max(sizes) - min(sizes)) * self.task.records[0].fs < HALF_SAMPLE
        return tuple(late) if alike and by_half(force, -float(np.mean(sizes)), self.task.records) else ()

    @property
    def early(self) -> tuple[str, ...]:
        """Forces that are early by half a sample, by their channels."""
        drives = forces_of_drives(self.task.model)
        own = tuple(one.channel for one in self.commands if one.channel in drives)
        return own or (drives if self.commands else ())
