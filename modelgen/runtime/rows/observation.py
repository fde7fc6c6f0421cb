"""Observation: the rows of Y = W X of all records, behind matched filters, at the samples kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from modelgen.array_types import IntArray
from modelgen.progress import counted
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.threads import give_back_freed
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.left_open.held_speeds import rows_with_open_rests
from modelgen.runtime.rows.masks import Survey, calm_masks, jump_places, near_jumps
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.remade_rows import remade_blocks
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.row_terms import holds_force, holds_gain, row_terms
from modelgen.runtime.rows.thresholds import JUMPS_FELT, LEAST_SHARE, MUCH_KEPT

# From so many columns a row holds those only that it touches: of a long chain that is a handful.
WIDE = 16


@dataclass(frozen=True, eq=False)
class Observation:
    """Rows of Y = W X, one block per record and row of the model; `columns` names the columns of W."""

    columns: tuple[str, ...]
    blocks: tuple[RowBlock, ...]
    notes: tuple[str, ...] = ()
    surveys: tuple[Survey, ...] = ()

    @property
    def turning(self) -> bool:
        """Whether some row uses samples that feel a reversal, as few others are left."""
        return any(block.turning for block in self.blocks)

    def dense(self) -> Observation:
        """Return the same with every column in every block."""
        return replace(self, blocks=tuple(block.dense(len(self.columns)) for block in self.blocks))


def observe(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int = 0,
    turns: bool | Literal["open"] = True,
    surveys: Sequence[Survey] = (),
    memory_limit: float | None = None,
    friction: bool = False,
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
    turns : bool or "open"
        Whether rows with Coulomb friction use the samples that feel a reversal (`turn_masks`). Where too few
        others would be left they do in any case. "open": they do, and those of an arm what feels a long rest,
        too, for `without_uncertain_turns` will make rows of them that do not.
    surveys : sequence of Survey, optional
        Those of an observation of these records with the same filter for directions.
    memory_limit : float, optional
        Bytes. Rows that take more are not kept but made again whenever they are asked for; those without
        `turns` are kept in any case.
    friction : bool
        Without `turns`, whether rows that drop friction where it is differentiated use samples that feel a
        reversal where too few others would be left; for those who add it (`modelgen.runtime.iv`).

    Raises
    ------
    DataError
        When a record is too short for the filter.
    """
    blocks: list[RowBlock] = []
    found: list[Survey] = []
    size = kept_bytes(model, records, choice)
    opened = rows_with_open_rests(model) if turns == "open" else ()
    remade = turns and memory_limit is not None and size > memory_limit
    if size > MUCH_KEPT and not all(record.in_memory for record in records):
        give_back_freed()
    notes = [f"drop = {drop} samples at the beginning of every record, as given"] if drop else []
    for index, record in enumerate(counted(records, "filtering")):
        survey = surveys[index] if surveys else None
        factor = choice.decimation[index]
        rows = matched_rows(model, record, choice, factor, drop, None, survey, opened)
        if not turns:
            rows = replace(rows, masks=calm_masks(model, choice, record.fs, rows.masks, friction))
            slow = choice.cutoff_hz > JUMPS_FELT * record.fs
            if rows.survey.jumps is None and slow and not model.is_arm:
                rows = replace(rows, survey=replace(rows.survey, jumps=jump_places(model, record)))
        found.append(rows.survey)
        for block in (
            remade_blocks(rows, index) if remade else _blocks(rows, index, None if turns else choice)
        ):
            blocks.append(block)
            if block.count == 0:
                notes.append(
                    f"{record.name}, row {block.row_name}: not used, every sample lies too near to a "
                    "reversal or a standstill"
                )
    return Observation(model.base_parameters, tuple(blocks), tuple(notes), tuple(found))


def kept_bytes(model: Model, records: Sequence[Record], choice: FilterChoice) -> float:
    """Return how many bytes the rows of the records take where they are kept."""
    columns = len(model.base_parameters)
    sizes = [len(terms.columns) if columns >= WIDE else columns for terms in row_terms(model)]
    points = sum(record.n / factor for record, factor in zip(records, choice.decimation, strict=True))
    return 8.0 * points * sum(size + 1 for size in sizes)


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

    def place(self, row: int, calm_at: FilterChoice | None) -> tuple[IntArray | None, bool]:
        """Return the samples that a row may use, None for all; and whether some of them feel a turn.

        With `calm_at` those that feel a jump of a force are left out, unless few others are left: friction
        that reverses all the time jumps with its sign.
        """
        masked, turning = self.masked[row], False
        further = len(self.rows.terms) + row
        if further < len(self.masked):
            calm = masked | self.masked[further]
            turning = bool(np.count_nonzero(~calm) < LEAST_SHARE * self.count)
            masked = masked if turning else calm
        jumps = self.rows.survey.jumps
        if calm_at is not None and not turning and jumps is not None and jumps[row].size:
            steady = masked | near_jumps(jumps[row], self.rows.grid, calm_at, self.rows.source.fs)
            if np.count_nonzero(~steady) >= LEAST_SHARE * np.count_nonzero(~masked):
                masked = steady
        return (np.flatnonzero(~masked).astype(np.int64) if masked.any() else None), turning


def _blocks(rows: RecordRows, index: int, calm: FilterChoice | None) -> Iterator[RowBlock]:
    """Yield the blocks of one record, the `index`-th; with `calm` without what feels jumps of forces."""
    kept = _Kept(rows)
    kept.all()
    model = rows.plan.model
    every = np.arange(kept.count)
    for terms, info in zip(rows.terms, model.rows, strict=True):
        place, turning = kept.place(terms.row, calm)
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
            has_force=holds_force(
                model, terms.row, float(np.linalg.norm(lines[-1])), force_scale * np.sqrt(n)
            ),
            by_gain=holds_gain(model, terms.row),
            force_scale=force_scale,
            differentiated=info.differentiated,
            start=rows.grid[0],
            touched=np.array(terms.columns, dtype=np.int64) if kept.wide else None,
            turning=turning,
        )
