"""RecordRows: the rows of a model on one record, made chunk by chunk, whatever the length of the record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.record_length import end_samples, samples_needed, shorter_ways
from modelgen.runtime.filters.fused_operator import fused_operator
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.numerics.threads import each
from modelgen.runtime.records.channels import Channels, read_continued
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk, chunk_points, chunks, made_once
from modelgen.runtime.rows.filter_sections import Filtering, matched_filtering
from modelgen.runtime.rows.masks import NOTHING, RowMask, Survey, row_masks, standstill_speed
from modelgen.runtime.rows.row_terms import RowTerms, row_terms
from modelgen.runtime.rows.signal_plan import SignalPlan, signal_plan

Found = TypeVar("Found")

# From so many samples on, compiled filters save more than the half second that loading numba takes.
COMPILED_SAMPLES = 500_000


@dataclass(frozen=True, eq=False)
class RecordRows:
    """One record and how the rows of a model are made of it, in SI.

    Attributes
    ----------
    source : Channels
    plan : SignalPlan
    grid : range
        Samples of the record that are kept.
    masks : tuple of RowMask
        One a row; empty where nothing is masked.
    survey : Survey
        What the masks need to know of the whole record.
    samples : int, optional
        Samples in a chunk; changes memory and speed, never the result.
    """

    source: Channels
    plan: SignalPlan
    grid: range
    masks: tuple[RowMask, ...] = ()
    survey: Survey = NOTHING
    samples: int | None = None

    @property
    def terms(self) -> tuple[RowTerms, ...]:
        """Rows of the model."""
        return row_terms(self.plan.model)

    @property
    def halo(self) -> int:
        """Samples around a chunk that the masks look at."""
        return max((mask.halo for mask in self.masks), default=0) if self.plan.directions else 0

    def chunks(self) -> Iterator[Chunk]:
        """Yield the chunks of the samples kept; each reads when asked, and is to be let go after that."""
        return chunks(self.source, self.plan, self.grid, self.halo, self.samples)

    @property
    def shared_out(self) -> bool:
        """Whether several threads take a chunk each.

        Linear rows of what is in memory are made by so short steps that threads would wait for the
        interpreter between them: as long as one of them takes, and half as much of the processor again.
        """
        in_memory = isinstance(self.source, Record) and self.source.in_memory
        return self.plan.fast or self.plan.kernel is not None or not in_memory

    def over_chunks(self, work: Callable[[Chunk], Found]) -> Iterator[Found]:
        """Yield what a function makes of each chunk, in their order; see `shared_out`."""
        if not self.shared_out:
            return map(work, self.chunks())
        points = chunk_points(self.plan, self.halo, self.samples)
        return each(work, self.chunks(), -(-len(self.grid) // points))

    def for_chunks(self, fill: Callable[[Chunk], None]) -> None:
        """Call a function with each chunk; see `shared_out`."""
        for _ in self.over_chunks(fill):
            pass

    def lines(
        self, terms: Sequence[RowTerms] | None = None, places: Sequence[IntArray] | None = None
    ) -> tuple[FloatArray, ...]:
        """Return entries of rows, in lines: by default the columns that each touches and y, masked or not.

        `terms` are other rows and entries, `places` the points of the grid that are asked for of each, in
        rising order. One array a row, shape (entries, points).
        """
        rows = self.terms if terms is None else terms
        of = [np.arange(len(self.grid))] * len(rows) if places is None else places
        found = tuple(np.empty((len(row.entries), len(place))) for row, place in zip(rows, of, strict=True))

        def fill(chunk: Chunk) -> None:
            signals = chunk.signals()
            for row, place, lines in zip(rows, of, found, strict=True):
                part = slice(*np.searchsorted(place, (chunk.index, chunk.index + chunk.count)).tolist())
                if part.stop - part.start == chunk.count:
                    row.fill(lines[:, part], signals)
                else:
                    lines[:, part] = row.evaluate(signals)[:, place[part] - chunk.index]

        self.for_chunks(fill)
        return found

    def mixed(self, mixtures: Sequence[Mapping[str, float]]) -> FloatArray:
        """Return sums of signals and features at all samples kept, shape (mixtures, grid): a weight a key."""
        found = np.zeros((len(mixtures), len(self.grid)))

        def fill(chunk: Chunk) -> None:
            signals, part = chunk.signals(), slice(chunk.index, chunk.index + chunk.count)
            for line, weights in zip(found, mixtures, strict=True):
                for key, weight in weights.items():
                    line[part] += weight * signals[key]

        self.for_chunks(fill)
        return found

    def derivatives(self, source: str, orders: Sequence[int]) -> FloatArray:
        """Return filtered derivatives of a channel or feature at the samples kept, shape (grid, orders)."""
        filtering = self.plan.filtering
        operator = fused_operator(
            filtering.linear,
            filtering.fs,
            tuple(orders),
            filtering.factor,
            filtering.stencil,
            fast=self.plan.fast,
        )
        before, behind = operator.margins

        found = np.empty((len(self.grid), len(orders)), order="F")

        def fill(chunk: Chunk) -> None:
            part = found[chunk.index : chunk.index + chunk.count]
            if source in self.plan.features:
                feature = self.plan.features[source]
                part[:] = self.plan.filtered_feature(chunk, feature, operator, chunk.first, chunk.count)
            else:
                samples = read_continued(self.source, source, chunk.start - before, chunk.stop + behind)
                part[:] = operator.apply(samples, before, chunk.count)

        self.for_chunks(fill)
        return found

    def feature(self, feature: Feature) -> FloatArray:
        """Return a nonlinear feature, formed at the full rate and filtered, at the samples kept, (grid,)."""
        found = np.empty(len(self.grid))

        def fill(chunk: Chunk) -> None:
            part = found[chunk.index : chunk.index + chunk.count]
            part[:] = self.plan.feature(chunk, feature, chunk.first, chunk.count)

        self.for_chunks(fill)
        return found


def matched_rows(
    model: Model,
    source: Channels,
    choice: FilterChoice,
    factor: int,
    drop: int = 0,
    samples: int | None = None,
    survey: Survey | None = None,
    rests_open: tuple[int, ...] = (),
) -> RecordRows:
    """Return the rows behind one common filter, with masks, on a grid that keeps off both ends.

    As `unmasked_rows`; `survey` is that of the record with the same filter for directions, if there is one.
    `rests_open` as for `row_masks`.

    Raises
    ------
    DataError
        When the record is too short for the filter.
    """
    rows = replace(
        unmasked_rows(model, source, choice, factor, drop),
        masks=row_masks(model, choice, source.fs, rests_open),
        samples=samples,
    )
    plan = rows.plan
    if survey is not None or not plan.directions:
        return replace(rows, survey=survey or NOTHING)
    every = RecordRows(source, full_rate(plan), range(source.n), samples=samples)
    return replace(rows, survey=_survey(every))


def _survey(every: RecordRows) -> Survey:
    """Return the survey of a record, from rows that keep every sample of it."""

    def speed(key: str) -> FloatArray:
        velocities = every.over_chunks(lambda chunk: chunk.direction(key, chunk.start, chunk.stop))
        return standstill_speed(velocities, every.source.n)

    return Survey(
        {
            key: float(made_once(every.source, channel, ("standstill", smooth), partial(speed, key))[0])
            for key, (channel, smooth) in every.plan.directions.items()
        }
    )


def unmasked_rows(
    model: Model, source: Channels, choice: FilterChoice, factor: int, drop: int = 0
) -> RecordRows:
    """Return the rows behind one common filter at all samples of a grid that keeps off both ends.

    y = D x holds at every instant, so it holds for any linear filter of y and D, exactly, as long as the
    filter is the same for both: forces, constants and signs of velocities included.

    Raises
    ------
    DataError
        When the record is too short for the filter.
    """
    order, cutoff_hz = choice.filter_order, choice.cutoff_hz
    edge = end_samples(model, order, cutoff_hz, source.fs)
    start = max(edge, drop)
    needed = start - edge + samples_needed(model, order, cutoff_hz, source.fs, factor)
    if source.n < needed:
        raise DataError.at(
            source.name,
            f"has {source.n} samples; a filter of {cutoff_hz:.4g} Hz needs at least {needed}",
            shorter_ways(model, source, order, cutoff_hz, factor, drop),
        )
    fast = None if source.n >= COMPILED_SAMPLES else False
    plan = signal_plan(model, _as_noisy(matched_filtering(choice, source.fs, factor), source), fast)
    return RecordRows(source, plan, range(start, source.n - edge, factor))


def _as_noisy(filtering: Filtering, source: Channels) -> Filtering:
    """Return filters that know of the noise of a record: a low-pass that was undone has made it louder."""
    if not filtering.faster or not isinstance(source, Record):
        return filtering
    own = {one.channel: source.facts.spectrum(one.channel).noise for one in filtering.faster}
    louder = (replace(one, noise=max(one.noise, own[one.channel])) for one in filtering.faster)
    return replace(filtering, faster=tuple(louder))


def full_rate(plan: SignalPlan) -> SignalPlan:
    """Return the plan for walking through every sample of a record; its directions are the same."""
    return replace(plan, filtering=replace(plan.filtering, factor=1))
