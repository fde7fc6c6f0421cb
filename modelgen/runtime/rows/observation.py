"""Observation: the rows of Y = W X of all records, behind matched filters, at the samples kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem
from modelgen.progress import counted
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.qr_triangle import triangle_of
from modelgen.runtime.records.channels import RecordChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.masks import turn_masks
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A left-hand side below this share of the record's forces counts as none.
LEAST_FORCE = 1e-2
# A body that reverses all the time leaves less than this share of the grid: then its turns are kept.
LEAST_SHARE = 0.3


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
    W : array, shape (n, columns)
        Observation matrix.
    masked : int
        Samples of the grid left out.
    has_force : bool
        Whether a force fixes the scale of the row. The left-hand side of a load row is zero, or nearly so
        where its actuator rests.
    force_scale : float
        Rms on the grid of the forces, differentiated as often as the row: the size of what a row balances.
    start : int
        Sample of the record at the grid's first point.
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

    @cached_property
    def triangle(self) -> FloatArray:
        """R of [W Y], shape (columns + 1, columns + 1): all that weights and rms of residuals ask for."""
        return triangle_of(np.column_stack([self.W, self.Y]))

    def residual_norm(self, x: FloatArray) -> float:
        """Return the norm of Y - W x."""
        return float(np.linalg.norm(self.triangle[:, -1] - self.triangle[:, :-1] @ x))


@dataclass(frozen=True, eq=False)
class Observation:
    """Rows of Y = W X, one block per record and row of the model; `columns` names the columns of W."""

    columns: tuple[str, ...]
    blocks: tuple[RowBlock, ...]
    notes: tuple[str, ...] = ()


def observe(
    model: Model, records: Sequence[Record], choice: FilterChoice, drop: int = 0, turns: bool = True
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

    Raises
    ------
    DataError
        When a record is too short for the filter.
    """
    blocks: list[RowBlock] = []
    notes = [f"drop = {drop} samples at the beginning of every record, as given"] if drop else []
    for index, record in enumerate(counted(records, "filtering")):
        rows = matched_rows(model, RecordChannels(record), choice, choice.decimation[index], drop)
        if not turns:
            rows = replace(rows, masks=rows.masks + turn_masks(model, choice, record.fs))
        for block in _blocks(rows, index):
            blocks.append(block)
            if block.place.size == 0:
                notes.append(
                    f"{record.name}, row {block.row_name}: not used, every sample lies too near to a "
                    "reversal or a standstill"
                )
    return Observation(model.base_parameters, tuple(blocks), tuple(notes))


def runs_of(place: IntArray) -> list[IntArray]:
    """Return the indices of samples that are neighbours on the grid, gap by gap."""
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


@dataclass(frozen=True, eq=False)
class _Part:
    """One chunk: of every row its lines, and which samples are masked; the power of the forces."""

    lines: list[FloatArray]
    masked: list[npt.NDArray[np.bool_]]
    force_power: Mapping[int, float]


def _part(rows: RecordRows, chunk: Chunk) -> _Part:
    signals = chunk.signals()
    lines = []
    for terms in rows.terms:
        lines.append(terms.evaluate(signals)[1:])
        signals.forget(terms.row)
    masked = [mask.of(chunk, rows.survey.thresholds) for mask in rows.masks]
    return _Part(lines, masked, signals.force_power)


def _blocks(rows: RecordRows, index: int) -> list[RowBlock]:
    """Return the blocks of one record, the `index`-th."""
    model, count = rows.plan.model, len(rows.grid)
    parts = list(rows.over_chunks(lambda chunk: _part(rows, chunk)))
    masks = [np.concatenate(masked) for masked in zip(*(part.masked for part in parts), strict=True)]
    found = []
    for terms, info in zip(rows.terms, model.rows, strict=True):
        masked = masks[terms.row]
        if len(masks) > len(model.rows):
            calm = masked | masks[len(model.rows) + terms.row]
            masked = calm if np.count_nonzero(~calm) >= LEAST_SHARE * count else masked
        place = np.flatnonzero(~masked).astype(np.int64)
        lines = np.concatenate([part.lines[terms.row] for part in parts], axis=1)[:, place]
        W = np.zeros((len(place), len(model.base_parameters)))
        W[:, list(terms.columns)] = lines[:-1].T
        power = sum(part.force_power.get(info.differentiated, 0.0) for part in parts) / count
        force_scale = float(np.sqrt(power)) / info.lever
        found.append(
            RowBlock(
                record=index,
                row=terms.row,
                record_name=rows.source.name,
                row_name=info.name,
                unit=info.unit,
                place=place,
                grid=count,
                Y=lines[-1],
                W=W,
                masked=count - len(place),
                has_force=bool(np.linalg.norm(lines[-1]) > LEAST_FORCE * force_scale * np.sqrt(len(place))),
                force_scale=force_scale,
                differentiated=info.differentiated,
                start=rows.grid[0],
            )
        )
    return found
