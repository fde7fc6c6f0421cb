"""Observation: the rows of Y = W X of all records, behind matched filters, at the samples kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError, Problem
from modelgen.progress import counted
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.qr_triangle import tall_triangle
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.masks import turn_masks
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.row_triangles import RowTriangle
from modelgen.runtime.rows.standstill_speeds import Survey
from modelgen.runtime.rows.thresholds import LEAST_FORCE, LEAST_SHARE

# From so many columns a row holds those only that it touches: of a long chain that is a handful.
WIDE = 40


@dataclass(frozen=True, eq=False)
class RowBlock:
    """The samples of one row of the model on one record.

    Attributes
    ----------
    record, row : int
        Index of the record and of the row; `record_name`, `row_name` name them.
    place : array of int, shape (n,)
        Position of each sample on the record's decimated grid of `grid` samples; what is masked is left out.
    Y : array, shape (n,)
        Left-hand side, in `unit`.
    W : array, shape (n, columns), or (n, touched)
        Observation matrix; in wide observations its columns that the row touches.
    masked : int
        Samples of the grid left out.
    has_force : bool
        Whether a force fixes the scale of the row. The left-hand side of a load row is zero, or nearly so
        where its actuator rests.
    force_scale : float
        Rms on the grid of the forces, differentiated as often as the row: the size of what a row balances.
    start : int
        Sample of the record at the grid's first point.
    touched : array of int, optional
        Which columns of the observation those of W are; None for all of them.
    """

    record: int
    row: int
    record_name: str
    row_name: str
    unit: str
    place: IntArray
    grid: int
    Y: FloatArray
    W: FloatArray
    masked: int
    has_force: bool
    force_scale: float
    differentiated: int
    start: int = 0
    touched: IntArray | None = None

    @cached_property
    def summary(self) -> RowTriangle:
        """All that weights, and sizes of residuals and terms, ask of the rows."""
        triangle = tall_triangle(self.W, self.Y)
        count, touched = len(self.place), self.touched
        return RowTriangle(
            self.record, self.row, count, self.grid, self.has_force, self.force_scale, triangle, touched
        )

    @property
    def triangle(self) -> FloatArray:
        """R of [1 W Y], shape (k + 2, k + 2)."""
        return self.summary.triangle

    def own(self, x: FloatArray) -> FloatArray:
        """Return the entries that belong to the columns of W, of an array of shape (columns, ...)."""
        return x if self.touched is None else np.asarray(x[self.touched])

    def residual(self, x: FloatArray) -> FloatArray:
        """Return Y - W x, shape (n,); x is in the order of all columns."""
        return np.asarray(self.Y - self.W @ self.own(x))

    def terms_norm(self, x: FloatArray) -> float:
        """Return the norm of the largest term; see `RowTriangle`."""
        return self.summary.terms_norm(x)

    def size(self, x: FloatArray) -> float:
        """Return the norm that a residual is compared with; see `RowTriangle`."""
        return self.summary.size(x)

    def column(self, index: int) -> FloatArray:
        """Return a column of the observation in this row, shape (n,)."""
        if self.touched is None:
            return self.W[:, index]
        place = np.flatnonzero(self.touched == index)
        return self.W[:, place[0]] if place.size else np.zeros(len(self.Y))

    def chosen(self, columns: Sequence[int]) -> RowBlock:
        """Return the block with these of all columns only, in their order."""
        if self.touched is None:
            # all of them in their order need no copy
            whole = list(columns) == list(range(self.W.shape[1]))
            return self if whole else replace(self, W=self.W[:, columns])
        place = {int(column): index for index, column in enumerate(self.touched)}
        kept = [index for index, column in enumerate(columns) if column in place]
        W = self.W[:, [place[columns[index]] for index in kept]]
        return replace(self, W=W, touched=np.array(kept, dtype=np.int64))

    def dense(self, columns: int) -> RowBlock:
        """Return the block with all of so many columns."""
        if self.touched is None:
            return self
        W = np.zeros((len(self.Y), columns))
        W[:, self.touched] = self.W
        return replace(self, W=W, touched=None)


@dataclass(frozen=True, eq=False)
class Observation:
    """Rows of Y = W X, one block per record and row of the model; `columns` names the columns of W."""

    columns: tuple[str, ...]
    blocks: tuple[RowBlock, ...]
    notes: tuple[str, ...] = ()
    surveys: tuple[Survey, ...] = ()

    def dense(self) -> Observation:
        """Return the same with every column in every block."""
        return replace(self, blocks=tuple(block.dense(len(self.columns)) for block in self.blocks))


def observe(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int = 0,
    turns: bool = True,
    surveys: Sequence[Survey] = (),
) -> Observation:
    """Return the matched-filtered rows of the records.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        With all of ``model.channels``.
    choice : FilterChoice
        Order, cut-offs and decimation.
    drop : int
        Samples to leave out at the beginning of every record; never fewer than the filter's reach.
    turns : bool
        Whether rows with Coulomb friction use the samples that feel a reversal (`turn_masks`). Where too few
        others would be left they do in any case.
    surveys : sequence of Survey, optional
        Those of an observation of these records with the same filter for directions.

    Raises
    ------
    DataError
        When a record is too short for the filter.
    """
    blocks: list[RowBlock] = []
    found: list[Survey] = []
    notes = [f"drop = {drop} samples at the beginning of every record, as given"] if drop else []
    for index, record in enumerate(counted(records, "filtering")):
        survey = surveys[index] if surveys else None
        rows = matched_rows(model, record, choice, choice.decimation[index], drop, survey=survey)
        found.append(rows.survey)
        if not turns:
            rows = replace(rows, masks=rows.masks + turn_masks(model, choice, record.fs))
        for block in _blocks(rows, index):
            blocks.append(block)
            if block.place.size == 0:
                notes.append(
                    f"{record.name}, row {block.row_name}: not used, every sample lies too near to a "
                    "reversal or a standstill"
                )
    return Observation(model.base_parameters, tuple(blocks), tuple(notes), tuple(found))


def runs_of(place: IntArray) -> list[IntArray]:
    """Return the indices of samples that are neighbours on the grid, gap by gap; `place` has shape (n,)."""
    return np.split(np.arange(len(place)), np.flatnonzero(np.diff(place) != 1) + 1)


def rows_by_tag(
    observation: Observation, records: Sequence[Record], rows_for_tag: Mapping[str, Sequence[str]]
) -> Observation:
    """Return the observation with only those rows that a record's tag may feed; other tags feed all rows.

    Raises
    ------
    DataError
        When a tag is no record's, or a row's name is unknown.
    """
    tags = dict.fromkeys(record.tag for record in records)
    names = dict.fromkeys(block.row_name for block in observation.blocks)
    problems = [
        Problem("rows_for_tag", f"no record has the tag {tag!r}", "give the records' tags")
        for tag in rows_for_tag
        if tag not in tags
    ]
    problems += [
        Problem(f"rows_for_tag[{tag!r}]", f"{row!r} is no row", f"choose from {', '.join(names)}")
        for tag, rows in rows_for_tag.items()
        for row in rows
        if row not in names
    ]
    if problems:
        raise DataError(*problems)
    allowed = [rows_for_tag.get(record.tag or "", tuple(names)) for record in records]
    blocks = tuple(block for block in observation.blocks if block.row_name in allowed[block.record])
    return replace(observation, blocks=blocks)


class _Kept:
    """The rows of one record at all samples kept, filled chunk by chunk: lines W and Y of every row."""

    def __init__(self, rows: RecordRows) -> None:
        self.rows, self.count = rows, len(rows.grid)
        columns = len(rows.plan.model.base_parameters)
        self.wide = columns >= WIDE
        sizes = [len(terms.columns) if self.wide else columns for terms in rows.terms]
        self.lines = [np.zeros((size + 1, self.count)) for size in sizes]
        self.masked = np.zeros((len(rows.masks), self.count), dtype=bool)
        self.force_power: dict[int, float] = {}

    def take(self, chunk: Chunk) -> Mapping[int, float]:
        """Fill in the samples of a chunk; return the power of its forces. Chunks may come from threads."""
        signals, part = chunk.signals(), slice(chunk.index, chunk.index + chunk.count)
        for terms, lines in zip(self.rows.terms, self.lines, strict=True):
            places = range(len(terms.columns)) if self.wide else terms.columns
            terms.fill([*(lines[place, part] for place in places), lines[-1, part]], signals)
            signals.forget(terms.row)
        for mask, masked in zip(self.rows.masks, self.masked, strict=True):
            masked[part] = mask.of(chunk, self.rows.survey.thresholds)
        return signals.force_power

    def all(self) -> None:
        """Fill in all chunks; the powers add up in their order."""
        for power in self.rows.over_chunks(self.take):
            for times, more in power.items():
                self.force_power[times] = self.force_power.get(times, 0.0) + more

    def place(self, row: int) -> IntArray | None:
        """Return the samples that a row may use; None for all."""
        masked = self.masked[row]
        further = len(self.rows.terms) + row
        if further < len(self.masked):
            calm = masked | self.masked[further]
            masked = calm if np.count_nonzero(~calm) >= LEAST_SHARE * self.count else masked
        return np.flatnonzero(~masked).astype(np.int64) if masked.any() else None


def _blocks(rows: RecordRows, index: int) -> Iterator[RowBlock]:
    """Yield the blocks of one record, the `index`-th."""
    kept = _Kept(rows)
    kept.all()
    every = np.arange(kept.count)
    for terms, info in zip(rows.terms, rows.plan.model.rows, strict=True):
        place = kept.place(terms.row)
        lines = kept.lines[terms.row] if place is None else kept.lines[terms.row][:, place]
        kept.lines[terms.row] = lines[:0].copy()  # one row at a time stands in memory twice
        force_scale = float(np.sqrt(kept.force_power.get(info.differentiated, 0.0) / kept.count)) / info.lever
        n = lines.shape[1]
        yield RowBlock(
            record=index,
            row=terms.row,
            record_name=rows.source.name,
            row_name=info.name,
            unit=info.unit,
            place=every if place is None else place,
            grid=kept.count,
            Y=lines[-1],
            W=lines[:-1].T,
            masked=kept.count - n,
            has_force=bool(np.linalg.norm(lines[-1]) > LEAST_FORCE * force_scale * np.sqrt(n)),
            force_scale=force_scale,
            differentiated=info.differentiated,
            start=rows.grid[0],
            touched=np.array(terms.columns, dtype=np.int64) if kept.wide else None,
        )
