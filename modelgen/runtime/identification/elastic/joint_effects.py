"""What rows of an elastic arm show of errors of its channels, estimated together with the parameters."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_bias import noise_effect
from modelgen.runtime.identification.elastic.channel_errors import (
    SetRight,
    resolved,
    set_right,
    tried_size,
)
from modelgen.runtime.identification.elastic.row_forces import RowForce, force_rows
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_wls
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
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.left_open.uncertain_turns import without_uncertain_turns
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.row_terms import mismatch_terms


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


def joint_effects(
    job: Job, candidates: Sequence[Effect], known: tuple[Effect, ...], rests: bool
) -> JointEffects:
    """Return the fit with the effects that are known, and those that rows show besides, one by one.

    What is large bends the rows, so that small ones seem to be off as well: while steps do not rest only what
    explains a large share of what is left is taken up.
    """
    job = replace(job, late=())
    fit = run_wls(job)[1]
    names = {effect.name for effect in known}
    every = (*known, *(effect for effect in candidates if effect.name not in names))
    rows, base, chosen = _with_effects(job, fit, every), [*job.model.base_parameters], [*known]
    plain = _solved(rows, base)
    bias = noise_effect(job.model, job.records, job.choice, plain, seen=True).bias
    R = plain.triangle[:-1, :-1]
    pull = dict(zip(plain.columns, R.T @ (R @ np.where(np.isfinite(bias), bias, 0.0)), strict=True))
    while True:
        fit = _solved(rows, [*base, *(effect.name for effect in chosen)])
        pulls = np.array([pull.get(name, 0.0) for name in fit.columns])
        least = 0.0 if rests and (known or not chosen) else LARGE_PART
        rest = [effect for effect in every if effect not in chosen]
        told = [one for one in _shown(job, rows, fit, rest, pulls) if one.explained > least]
        # one channel tells the time of all others
        late = sum(effect.kind == "delay" for effect in chosen) + 1 == len(job.model.channels)
        told = [one for one in told if not (late and one.effect.kind == "delay")]
        if not told:
            return JointEffects(fit, tuple(chosen), pulls)
        chosen.append(_first(told, {actuator.key for actuator in job.model.actuators}))


def _first(told: Sequence[Score], forces: Container[str]) -> Effect:
    """Return what explains most; of what explains as much, that a force is late."""
    equal = [one.effect for one in told if one.explained > ALIKE_PART * told[0].explained]
    late = [effect for effect in equal if effect.kind == "delay" and effect.channel in forces]
    return (*late, *equal)[0]


def _solved(rows: Observation, names: Sequence[str]) -> Fit:
    places = [rows.columns.index(name) for name in names]
    blocks = tuple(block.chosen(places) for block in rows.blocks)
    return fit_matched(replace(rows, columns=tuple(names), blocks=blocks))


def _shown(
    job: Job, rows: Observation, fit: Fit, rest: Sequence[Effect], pull: FloatArray
) -> Iterator[Score]:
    """Yield what is certain and matters of what a fit leaves, what explains most first.

    `pull`, shape (c,), is what noise adds to the products of the columns with Y - W X.
    """
    used = {(block.record, block.row): block for block in rows.blocks}
    blocks = [used[block.record, block.row] for block in fit.blocks]
    grown = [tuple(block.W[:, rows.columns.index(one.name)] for block in blocks) for one in rest]
    for one in scores(Span(fit), rest, grown, LEAST_ALIGNED_SHARE):
        if one.matters and one.effect.possible(one.size) and resolved(one.effect, one.size, job.records):
            pulled = abs(float(one.move @ pull) / (one.size * one.power))
            if abs(one.size) - pulled > MORE_CERTAIN * one.least:
                yield one


def _with_effects(job: Job, fit: Fit, effects: Sequence[Effect]) -> Observation:
    """Return the rows of a job with what each effect adds to them per unit as further columns."""
    raw = replace(job, leave_open=False).observed(job.records, job.turns).dense()
    terms = mismatch_terms(job.model, fit.all_parameters(job.model.base_parameters))
    plain = [_mismatch(job, record, index, terms) for index, record in enumerate(job.records)]
    grown = [list(_grown(job, effects, index, terms, plain[index])) for index in range(len(job.records))]

    def extended(block: RowBlock) -> RowBlock:
        more = [lines[block.row][block.place] for lines in grown[block.record]]
        return replace(block.kept(), W=np.column_stack([block.W, *more]))

    columns = (*raw.columns, *(effect.name for effect in effects))
    rows = replace(raw, columns=columns, blocks=tuple(extended(block) for block in raw.blocks))
    if not job.leave_open:
        return rows
    return without_uncertain_turns(rows, job.model, job.records, job.choice, job.drop, job.turns)


def _grown(
    job: Job, effects: Sequence[Effect], index: int, terms: Sequence[dict[str, float]], plain: FloatArray
) -> Iterator[FloatArray]:
    """Yield how Y - W X of a record grows per unit of each effect, shape (rows, grid)."""
    record, factor = job.records[index], job.choice.decimation[index]
    for effect in effects:
        if isinstance(effect, RowForce):
            yield force_rows(effect, job.model, record, job.choice, factor, job.drop)
            continue
        size = tried_size(effect, record)
        moved = set_right(job.model, record, index, {effect: size})
        # a record set right by so much lacks it
        yield (plain - _mismatch(job, moved, index, terms)) / size


def _mismatch(job: Job, record: Record, index: int, terms: Sequence[dict[str, float]]) -> FloatArray:
    rows = unmasked_rows(job.model, record, job.choice, job.choice.decimation[index], job.drop)
    return rows.mixed(terms)
