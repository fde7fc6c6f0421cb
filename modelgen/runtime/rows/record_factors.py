"""RecordFactors: a record in constant memory -> one small triangle for each row of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.model import Model, RowInfo
from modelgen.runtime.numerics.qr_update import compiled_take_in
from modelgen.runtime.numerics.threads import usable_threads
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.rows.chunk import Chunk, chunks
from modelgen.runtime.rows.filter_sections import matched_filtering
from modelgen.runtime.rows.filtered_record import SUPPORT_TOLERANCE
from modelgen.runtime.rows.masks import RowMask, row_masks
from modelgen.runtime.rows.row_factor import RowFactor, empty_factor
from modelgen.runtime.rows.row_terms import RowTerms, row_terms
from modelgen.runtime.rows.signal_plan import SignalPlan, signal_plan
from modelgen.runtime.rows.standstill_speeds import NOTHING, Survey, survey_record

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Task:
    """One record and what is to be done with it, chunk by chunk.

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
    def rows(self) -> tuple[RowTerms, ...]:
        """Rows of the model."""
        return row_terms(self.plan.model)

    @property
    def halo(self) -> int:
        """Samples around a chunk that the masks look at."""
        return max((mask.halo for mask in self.masks), default=0)

    def chunks(self) -> Iterator[Chunk]:
        """Yield the chunks of the samples kept; each reads when asked, and is to be let go after that."""
        return chunks(self.source, self.plan, self.grid, self.halo, self.samples)

    def places(self, chunk: Chunk) -> list[IntArray | None]:
        """Return for each row the places in the chunk that it may use; None for all."""
        if not self.masks:
            return [None] * len(self.plan.model.rows)
        found: list[IntArray | None] = []
        for mask in self.masks:
            masked = mask.of(chunk, self.survey.thresholds)
            found.append(np.flatnonzero(~masked).astype(np.int64) if masked.any() else None)
        return found


@dataclass(frozen=True, eq=False)
class RecordFactors:
    """The rows of one record.

    Attributes
    ----------
    name : str
        Of the record.
    grid : int
        Samples kept, masked or not.
    rows : tuple of RowFactor
        A triangle for each row of the model.
    force_power : mapping of int to float
        Number of differentiations to the sum over the grid of the squared forces (times their levers),
        differentiated so often.
    """

    name: str
    grid: int
    rows: tuple[RowFactor, ...]
    force_power: Mapping[int, float]

    def force_scale(self, row: RowInfo) -> float:
        """Return the rms of the forces, differentiated as often as a row and in its unit."""
        power = self.force_power.get(row.differentiated, 0.0) / self.grid
        return float(np.sqrt(power)) / row.lever

    def joined(self, other: RecordFactors, fast: bool | None = None) -> RecordFactors:
        """Return the factors of both stretches of the record; `fast` as for `RowFactor.with_rows`."""
        rows = tuple(a.joined(b, fast) for a, b in zip(self.rows, other.rows, strict=True))
        power = {
            times: self.force_power.get(times, 0.0) + other.force_power.get(times, 0.0)
            for times in dict.fromkeys((*self.force_power, *other.force_power))
        }
        return replace(self, grid=self.grid + other.grid, rows=rows, force_power=power)


def matched_task(
    model: Model,
    source: Channels,
    choice: FilterChoice,
    factor: int,
    drop: int = 0,
    samples: int | None = None,
    survey: Survey | None = None,
) -> Task:
    """Return the task of matched filtering, masks and grid as `modelgen.identify` has them.

    Raises
    ------
    DataError
        When the record is too short for the filter.
    """
    plan = signal_plan(model, matched_filtering(choice, source.fs, factor))
    deepest = max(signal.derivative for signal in model.signals)
    order, cutoff_hz = choice.filter_order, choice.cutoff_hz
    edge = max(support_samples(order, cutoff_hz, source.fs, k, SUPPORT_TOLERANCE) for k in range(deepest + 1))
    start = max(edge, drop)
    needed = start + edge + factor * (len(model.base_parameters) + 1)
    if source.n < needed:
        raise DataError.at(
            source.name,
            f"has {source.n} samples; a filter of {cutoff_hz:.4g} Hz needs at least {needed}",
            "give a longer record, or a higher cutoff_hz",
        )
    masks = row_masks(model, choice, source.fs)
    task = Task(source, plan, range(start, source.n - edge, factor), masks, samples=samples)
    if survey is not None or not plan.directions:
        return replace(task, survey=survey or NOTHING)
    every = Task(source, full_rate(plan), range(source.n), samples=samples)
    return replace(task, survey=survey_record(every.chunks(), plan, source.n))


def full_rate(plan: SignalPlan) -> SignalPlan:
    """Return the plan for walking through every sample of a record; its directions are the same."""
    return replace(plan, filtering=replace(plan.filtering, factor=1))


def record_factors(task: Task, threads: int | None = None) -> RecordFactors:
    """Return the factors of a record, chunk after chunk; those of no samples for an empty grid.

    Several threads (by default as many as `usable_threads` says) work on a chunk each. The chunks' factors
    are joined in their order all the same, so that the result is the same to the last bit.
    """
    if not len(task.grid):
        rows = tuple(empty_factor(terms.row, terms.columns) for terms in task.rows)
        return RecordFactors(task.source.name, 0, rows, {})

    def of(chunk: Chunk) -> RecordFactors:
        return chunk_factors(task, chunk)

    def joined(a: RecordFactors, b: RecordFactors) -> RecordFactors:
        return a.joined(b, task.plan.fast)

    workers = min(threads or usable_threads(), sum(1 for _ in task.chunks()))
    if workers == 1:
        return reduce(joined, map(of, task.chunks()))
    if task.plan.fast is not False:
        compiled_take_in()  # once, before threads ask for it side by side
    with ThreadPoolExecutor(workers) as pool:
        return reduce(joined, pool.map(of, task.chunks()))


def chunk_factors(task: Task, chunk: Chunk) -> RecordFactors:
    """Return the factors of one chunk."""
    signals = chunk.signals()
    factors = []
    for terms, place in zip(task.rows, task.places(chunk), strict=True):
        lines = terms.evaluate(signals)
        used = lines if place is None else lines[:, place]
        factor = replace(empty_factor(terms.row, terms.columns), masked=chunk.count - used.shape[1])
        factors.append(factor.with_rows(used, task.plan.fast) if used.shape[1] else factor)
        signals.forget(terms.row)
    return RecordFactors(task.source.name, chunk.count, tuple(factors), dict(signals.force_power))
