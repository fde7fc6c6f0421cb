"""Rows of an elastic arm with what each effect adds to them as further columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_bias import less_noise, lifted_along
from modelgen.runtime.identification.elastic.channel_errors import set_right, tried_size
from modelgen.runtime.identification.elastic.encoder_zeros import encoder_zeros, zeros_at_mean
from modelgen.runtime.identification.elastic.force_lags import is_lag, noise_along_lag
from modelgen.runtime.identification.elastic.link_forces import LinkForce, LinksInMotion
from modelgen.runtime.identification.elastic.row_forces import RowForce, force_rows
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.left_open.uncertain_turns import without_uncertain_turns
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import RecordRows, unmasked_rows
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.row_terms import mismatch_terms


@dataclass(frozen=True, eq=False)
class EffectRows:
    """Rows of the records of a job, and what effects add to Y - W X per unit of each.

    They add that at base parameters `point`, shape (columns,), in SI; by default those of least squares.
    `read` are the records as they were read, where effects are `undone` in those of the job, by their sizes.
    Effects that are put `aside` are not looked for, but may be there in place of what is.
    """

    job: Job
    effects: tuple[Effect, ...]
    point: FloatArray | None = None
    read: tuple[Record, ...] = ()
    undone: Mapping[Effect, float] = field(default_factory=dict)
    aside: tuple[Effect, ...] = ()

    @property
    def every(self) -> tuple[Effect, ...]:
        """All effects that rows have columns of."""
        return (*self.effects, *self.aside)

    def about(self, fit: Fit) -> EffectRows:
        """Return the same at the base parameters of a fit, which knows of effects."""
        return replace(self, point=fit.all_parameters(self.job.model.base_parameters))

    def solved(self, effects: Sequence[Effect]) -> Fit:
        """Return the fit of base parameters and sizes of effects, which are its last columns.

        Beside a gain of a force the first residual of rows without one was seventeen times as large, and what
        tells the gain was hardly weighed.
        """
        sizes = [effect.name for effect in effects]
        names = [*self.job.model.base_parameters, *sizes]
        places = [self.rows.columns.index(name) for name in names]
        blocks = tuple(block.chosen(places) for block in self.rows.blocks)
        return fit_matched(replace(self.rows, columns=tuple(names), blocks=blocks), further=sizes)

    def solved_at_own_point(self, effects: Sequence[Effect]) -> Fit:
        """Return the fit with what effects add at the parameters of a fit that knows of them.

        What a zero adds is that at the stiffness that goes with it.
        """
        return self.about(self.solved(effects)).solved(effects)

    def without(self, effect: Effect) -> EffectRows:
        """Return the same rows with an effect, and others of its name, put aside."""
        other = [one for one in self.effects if one.name == effect.name]
        kept = tuple(one for one in self.effects if one not in other)
        left = replace(self, effects=kept, aside=(*self.aside, *other))
        if "rows" in vars(self):
            vars(left)["rows"] = self.rows
        return left

    def grown(self, fit: Fit, effects: Sequence[Effect]) -> list[tuple[FloatArray, ...]]:
        """Return how Y - W X grows per unit of each effect, shape (rows,) a block of a fit of these rows."""
        used = {(block.record, block.row): block for block in self.rows.blocks}
        blocks = [used[block.record, block.row] for block in fit.blocks]
        places = [self.rows.columns.index(one.name) for one in effects]
        return [tuple(block.W[:, place] for block in blocks) for place in places]

    def pull(self, fit: Fit, columns: Sequence[str]) -> FloatArray:
        """Return what noise adds to the products of columns with Y - W X, shape (columns,), in SI.

        Rows are weighted as in the fit: what half a sample of a force leaves had a row weigh an eighth, and
        what noise does to gains of forces came out as a sixth.
        """
        job, read = self.job, self.read or self.job.records
        freed, noise = less_noise(job.model, job.records, job.choice, fit)
        R = fit.triangle[:-1, :-1]
        own = R.T @ (R @ np.where(np.isfinite(noise.bias), noise.bias, 0.0))
        added = dict(zip(fit.columns, own.tolist(), strict=True))
        # what an effect is like and noise adds on average: zeros of encoders where noisy speeds are squared
        blocks = self._blocks(fit)
        names = [effect.name for effect in self.every]
        along = lifted_along(job.model, job.records, job.choice, freed, blocks)
        added |= dict(zip(names, along.tolist(), strict=True))
        lags = {one.name: one for one in self.every if is_lag(one)}
        found = np.array([added.get(name, 0.0) for name in columns])
        for place, name in enumerate(columns):
            if name in lags:
                undone = self.undone.get(lags[name], 0.0)
                found[place] += noise_along_lag(job.model, read, job.choice, fit, lags[name], undone)
        return found

    def _blocks(self, fit: Fit) -> list[RowBlock]:
        """Return the columns of effects in the blocks of a fit of these rows."""
        places = [self.rows.columns.index(effect.name) for effect in self.every]
        used = {(block.record, block.row): block for block in self.rows.blocks}
        return [used[block.record, block.row].chosen(places) for block in fit.blocks]

    @cached_property
    def rows(self) -> Observation:
        """Rows with a column for each effect behind those of base parameters."""
        job = replace(self.job, late=())
        point = self.point
        if point is None:
            point = run_wls(job)[1].all_parameters(job.model.base_parameters)
        raw = job.with_rests(job.records, job.turns, opened=job.leave_open)
        raw = job.only_rows_for_tag(raw).dense()
        grown = [list(_grown(job, self.every, index, point)) for index in range(len(job.records))]

        def extended(block: RowBlock) -> RowBlock:
            more = [lines[block.row][block.place] for lines in grown[block.record]]
            return replace(block.kept(), W=np.column_stack([block.W, *more]))

        columns = (*raw.columns, *(effect.name for effect in self.every))
        rows = replace(raw, columns=columns, blocks=tuple(extended(block) for block in raw.blocks))
        if not job.leave_open:
            return rows
        return without_uncertain_turns(rows, job.model, job.records, job.choice, job.drop, job.turns)


def with_zeros_anew(job: Job) -> Job:
    """Return a job with zeros set right of encoders that read a deflection, as its rows show them."""
    zeros, count = tuple(encoder_zeros(job.model, len(job.records))), len(job.records)
    if not zeros:
        return job
    records = tuple(
        set_right(job.model, record, index, zeros_at_mean(job.model, record, index, count))
        for index, record in enumerate(job.records)
    )
    job = replace(job, records=records, surveys=())
    fit = EffectRows(job, zeros).solved_at_own_point(zeros)
    found = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
    sizes: dict[Effect, float] = {one: found.get(one.name, 0.0) for one in zeros}
    records = tuple(set_right(job.model, record, index, sizes) for index, record in enumerate(records))
    return replace(job, records=records)


def _grown(job: Job, effects: Sequence[Effect], index: int, point: FloatArray) -> Iterator[FloatArray]:
    """Yield how Y - W X of a record grows per unit of each effect, shape (rows, grid).

    `point` are base parameters, shape (columns,), in SI.
    """
    record, model = job.records[index], _without_slopes(job.model)
    terms = [
        {key: weight for key, weight in one.items() if model.kernel is None or key not in _slopes(job.model)}
        for one in mismatch_terms(model, point)
    ]

    def rows_of(changed: Record) -> RecordRows:
        return unmasked_rows(model, changed, job.choice, job.choice.decimation[index], job.drop)

    calm = rows_of(record)
    plain, links = calm.mixed(terms), LinksInMotion(calm, record, index, point)
    for effect in effects:
        if isinstance(effect, LinkForce):
            yield links.grown(effect)
        elif isinstance(effect, RowForce):
            yield force_rows(effect, calm, record, job.choice)
        elif effect.record not in (None, index):
            yield np.zeros_like(plain)
        else:
            size = tried_size(effect, record)
            # a record set right by so much lacks it
            moved = set_right(job.model, record, index, {effect: size})
            yield (plain - rows_of(moved).mixed(terms)) / size


def _without_slopes(model: Model) -> Model:
    """Return a model without what given positions change rows by: about the estimate that is zero."""
    kernel = model.kernel
    return replace(model, kernel=replace(kernel, rows=())) if isinstance(kernel, DeflectedKernel) else model


def _slopes(model: Model) -> frozenset[str]:
    """Return the keys of what that leaves out."""
    plain = _without_slopes(model).kernel
    return frozenset(model.kernel.keys if model.kernel else ()) - frozenset(plain.keys if plain else ())
