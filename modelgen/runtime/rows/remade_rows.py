"""Rows that are not kept: made again, chunk by chunk, whenever they are asked for.

One pass over a record gives the triangle of every row, which is all that weights, the solution and its
condition ask, and a bit a sample for what is masked. What asks for the residual itself walks through the rows
once more. The chunks are those of the first pass, so that the samples are the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, islice, pairwise
from typing import Generic, TypeVar

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.model.model import Feature
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.row_block import STRETCH, DrawnBlock, RowBlock, Stretch
from modelgen.runtime.rows.row_triangles import Used, triangles_and_masks

Found = TypeVar("Found")


class ChunkWindow(Generic[Found]):
    """What a function makes of each chunk of a record, made again whenever asked for; the last ones stay."""

    def __init__(self, rows: RecordRows, make: Callable[[Chunk], Found]) -> None:
        self._rows, self._make = rows, make
        self.size = next(rows.chunks()).count
        # a stretch is asked for of one row after the other
        self._last = -(-STRETCH // self.size) + 1
        self._made: dict[int, Found] = {}

    def __getitem__(self, number: int) -> Found:
        if number not in self._made:
            while len(self._made) >= self._last:
                del self._made[next(iter(self._made))]
            self._made[number] = self._make(next(islice(self._rows.chunks(), number, None)))
        return self._made[number]

    def numbers(self, start: int, stop: int) -> range:
        """Return which chunks hold these points of the grid; one at least."""
        return range(start // self.size, max(-(-stop // self.size), start // self.size + 1))


class RemadeFeature:
    """A nonlinear feature behind the filter, see `RecordRows.feature`, in stretches."""

    def __init__(self, rows: RecordRows, feature: Feature) -> None:
        def of(chunk: Chunk) -> FloatArray:
            return rows.plan.feature(chunk, feature, chunk.first, chunk.count)

        self._window = ChunkWindow(rows, of)

    def __getitem__(self, place: IntArray) -> FloatArray:
        """Return the values at points of the grid, in rising order, shape (n,)."""
        if not place.size:
            return np.zeros(0)
        window, start = self._window, int(place[0])
        numbers = window.numbers(start, int(place[-1]) + 1)
        return np.concatenate([window[number] for number in numbers])[place - numbers.start * window.size]


class RemadeRecord:
    """The rows of one record, in SI; `used` says which samples each row uses, chunk by chunk."""

    def __init__(self, rows: RecordRows, used: tuple[tuple[Used, ...], ...]) -> None:
        self.rows, self.used, self.grid = rows, used, len(rows.grid)
        self.chunks = ChunkWindow(rows, partial(RemadeChunk, self))
        self._firsts = [[0, *accumulate(one.samples for one in of_row)] for of_row in used]

    def mask(self, number: int, row: int) -> BoolArray:
        """Return which points of the grid a row uses in a chunk, shape (points,)."""
        count, bits = (
            min(self.chunks.size, self.grid - number * self.chunks.size),
            self.used[row][number].bits,
        )
        if bits is None:
            return np.ones(count, dtype=bool)
        return np.unpackbits(bits, count=count).astype(bool)

    def stretch(self, chunk: Chunk, signals: Mapping[str, FloatArray], row: int) -> Stretch:
        """Return the samples of a row, by its place among the terms, that are used in a chunk.

        Signals have shape (points,).
        """
        number, terms = chunk.index // self.chunks.size, self.rows.terms[row]
        lines, mask = terms.evaluate(signals), self.mask(number, terms.row)
        place = np.flatnonzero(mask).astype(np.int64) + chunk.index
        lines = lines if mask.all() else lines[:, mask]
        firsts = self._firsts[row]
        return Stretch(slice(firsts[number], firsts[number + 1]), place, lines[-1], lines[:-1].T)


class RemadeChunk:
    """The rows of one chunk, each made when first asked for: some ask for one row of all chunks.

    What signals and lines several rows share is made once, and kept until all rows are made.
    """

    def __init__(self, record: RemadeRecord, chunk: Chunk) -> None:
        self._record, self._chunk = record, chunk
        self._signals: Mapping[str, FloatArray] | None = None
        self._made: dict[int, Stretch] = {}

    def __getitem__(self, row: int) -> Stretch:
        if row not in self._made:
            if self._signals is None:
                self._signals = self._chunk.signals()
            self._made[row] = self._record.stretch(self._chunk, self._signals, row)
            if len(self._made) == len(self._record.rows.terms):
                self._signals = None
        return self._made[row]


@dataclass(frozen=True, eq=False)
class RemadeRow:
    """One row of a record, in stretches."""

    record: RemadeRecord
    row: int

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""
        stop = min(stop, self.record.grid)
        numbers = self.record.chunks.numbers(min(start, self.record.grid - 1), stop)
        parts = [self._part(number, start, stop) for number in numbers]
        if len(parts) == 1:
            return parts[0]
        rows = slice(parts[0].rows.start, parts[-1].rows.stop)
        place, Y, W = (np.concatenate([part[k] for part in parts]) for k in (1, 2, 3))
        return Stretch(rows, place, Y, W)

    def _part(self, number: int, start: int, stop: int) -> Stretch:
        chunk = self.record.chunks[number][self.row]
        low, high = np.searchsorted(chunk.place, (start, stop)).tolist()
        rows, inside = slice(chunk.rows.start + low, chunk.rows.start + high), slice(low, high)
        return Stretch(rows, chunk.place[inside], chunk.Y[inside], chunk.W[inside])

    def longest_run(self, most: int) -> Stretch:
        """Return the longest stretch without a gap, or so many of its first samples."""
        best, since = range(0), 0
        for number in range(len(self.record.used[self.row])):
            first, mask = number * self.record.chunks.size, self.record.mask(number, self.row)
            gaps = np.flatnonzero(~mask) + first
            edges = [since - 1, *gaps.tolist()]
            for before, behind in pairwise(edges):
                if behind - before - 1 > len(best):
                    best = range(before + 1, behind)
            since = edges[-1] + 1
        if self.record.grid - since > len(best):
            best = range(since, self.record.grid)
        return self.between(best.start, min(best.stop, best.start + most))


def remade_blocks(rows: RecordRows, index: int) -> list[RowBlock]:
    """Return the blocks of one record, the `index`-th; their masks must look at chunks alone."""
    triangles, used = triangles_and_masks(rows, index)
    record = RemadeRecord(rows, used)
    blocks: list[RowBlock] = []
    for one, info in zip(triangles, rows.plan.model.rows, strict=True):
        fields = {
            "record": index,
            "row": one.row,
            "record_name": rows.source.name,
            "row_name": info.name,
            "unit": info.unit,
            "grid": one.grid,
            "masked": one.grid - one.count,
            "has_force": one.has_force,
            "force_scale": one.force_scale,
            "differentiated": info.differentiated,
            "start": rows.grid[0],
            "touched": one.touched,
            "by_gain": one.by_gain,
            "summary": one,
        }
        inside = range(0 if one.touched is None else len(one.touched))
        blocks.append(DrawnBlock(RemadeRow(record, one.row), inside, fields))
    return blocks
