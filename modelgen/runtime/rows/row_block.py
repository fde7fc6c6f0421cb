"""RowBlock: the samples of one row of the model on one record, whole or stretch by stretch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.numerics.qr_triangle import tall_triangle
from modelgen.runtime.rows.row_triangles import RowTriangle

# Points of the grid that are looked at together: of six elastic joints, 12 rows of up to 80 columns, 50 MB.
STRETCH = 1 << 13


class Stretch(NamedTuple):
    """Samples of a block within a stretch of the record's grid.

    Attributes
    ----------
    rows : slice
        Which of the block's samples they are.
    place : array of int, shape (n,)
        Their positions on the grid.
    Y : array, shape (n,)
    W : array, shape (n, columns of the block)
    """

    rows: slice
    place: IntArray
    Y: FloatArray
    W: FloatArray


class InStretches(Protocol):
    """What gives the samples of a block, as often as asked."""

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""

    def longest_run(self, most: int) -> Stretch:
        """Return the longest stretch without a gap, or so many of its first samples."""


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
        Whether the row balances a force. The left-hand side of a load row is zero, or nearly so where its
        actuator rests.
    force_scale : float
        Rms on the grid of the forces, differentiated as often as the row: the size of what a row balances.
    start : int
        Sample of the record at the grid's first point.
    touched : array of int, optional
        Which columns of the observation those of W are; None for all of them.
    turning : bool
        Whether samples that feel a reversal are among these although they should not be: there are too few
        others.
    by_gain : bool
        Whether a force of the row is a column, of a drive's gain.
    opened, opening : float, callable or None
        Along how many directions of all samples nothing is left, as forces are unknown there; what left that.
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
    turning: bool = False
    by_gain: bool = False
    opened: float = 0.0
    opening: Callable[[Stretch], Stretch] | None = None

    @cached_property
    def summary(self) -> RowTriangle:
        """All that weights, and sizes of residuals and terms, ask of the rows."""
        triangle = tall_triangle(self.W, self.Y)
        own = self.record, self.row, self.count, self.grid, self.has_force, self.force_scale
        return RowTriangle(*own, triangle, self.touched, self.by_gain, self.opened)

    @property
    def triangle(self) -> FloatArray:
        """R of [1 W Y], shape (k + 2, k + 2)."""
        return self.summary.triangle

    @property
    def count(self) -> int:
        """Samples used."""
        return len(self.place)

    @property
    def in_memory(self) -> bool:
        """Whether its samples are kept, and not made again whenever asked for."""
        return True

    def without(self, marked: BoolArray) -> RowBlock:
        """Return the block without the samples that are marked on the grid, shape (grid,)."""
        kept, used = self.kept(), ~marked[self.place]
        masked = self.masked + int(np.count_nonzero(~used))
        return replace(kept, place=self.place[used], Y=kept.Y[used], W=kept.W[used], masked=masked)

    def own(self, x: FloatArray) -> FloatArray:
        """Return the entries that belong to the columns of W, of an array of shape (columns, ...)."""
        return x if self.touched is None else np.asarray(x[self.touched])

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""
        rows = slice(*np.searchsorted(self.place, (start, stop)).tolist())
        return Stretch(rows, self.place[rows], self.Y[rows], self.W[rows])

    def stretches(self, points: int = STRETCH) -> Iterator[Stretch]:
        """Yield all samples used, so many points of the grid at a time."""
        return (self.between(start, start + points) for start in range(0, self.grid, points))

    def residual(self, x: FloatArray) -> FloatArray:
        """Return Y - W x, shape (n,), not to be changed; x is in the order of all columns."""
        found = np.asarray(self.Y - self.W @ self.own(x))
        found.flags.writeable = False
        return found

    def terms_norm(self, x: FloatArray) -> float:
        """Return the norm of the largest term, x of shape (columns,); see `RowTriangle`."""
        return self.summary.terms_norm(x)

    def size(self, x: FloatArray) -> float:
        """Return the norm that a residual is compared with, x of shape (columns,); see `RowTriangle`."""
        return self.summary.size(x)

    def column_norm(self, index: int) -> float:
        """Return the norm of a column of the observation in this row."""
        place = self.column_at(index)
        return 0.0 if place is None else float(np.linalg.norm(self.triangle[:, place + 1]))

    def column_mean(self, index: int) -> float:
        """Return the mean of a column of the observation in this row."""
        place = self.column_at(index)
        return 0.0 if place is None else float(self.triangle[0, 0] * self.triangle[0, place + 1]) / self.count

    def column_at(self, index: int) -> int | None:
        """Return which column of W a column of the observation is; None where the row does not touch it."""
        if self.touched is None:
            return index
        place = np.flatnonzero(self.touched == index)
        return int(place[0]) if place.size else None

    def longest_run(self, most: int) -> Stretch:
        """Return the longest stretch without a gap, or so many of its first samples."""
        if not len(self.place):
            return self.between(0, 0)
        edges = run_edges(self.place)
        longest = int(np.argmax(np.diff(edges)))
        first = int(self.place[edges[longest]])
        return self.between(first, first + min(int(edges[longest + 1] - edges[longest]), most))

    def chosen(self, columns: Sequence[int]) -> RowBlock:
        """Return the block with these of all columns only, in their order; nothing is copied."""
        every = list(range(self.triangle.shape[1] - 2)) if self.touched is None else self.touched.tolist()
        if self.touched is None and list(columns) == every:
            return self
        place = {column: index for index, column in enumerate(every)}
        kept = [index for index, column in enumerate(columns) if column in place]
        fields = {name: value for name, value in vars(self).items() if name not in ("Y", "W", "place")}
        fields["summary"] = self.summary.chosen(columns)
        fields["touched"] = None if self.touched is None else np.array(kept, dtype=np.int64)
        return DrawnBlock(self, [place[columns[index]] for index in kept], fields)

    def dense(self, columns: int) -> RowBlock:
        """Return the block with all of so many columns."""
        if self.touched is None:
            return self
        W = np.zeros((self.count, columns))
        W[:, self.touched] = self.W
        return replace(self.kept(), W=W, touched=None)

    def kept(self) -> RowBlock:
        """Return the block with its samples in arrays of its own, whose fields can be replaced."""
        return self


class DrawnBlock(RowBlock):
    """A block, in SI, of samples that are drawn from another source, by stretches, with some of its columns.

    The source is a block with more columns, or makes the samples again. Whoever asks for `Y`, `W`, or
    `place` gets them whole, which takes the memory of a block that keeps them.
    """

    source: InStretches
    inside: list[int]
    whole: Stretch | None

    def __init__(self, source: InStretches, inside: Sequence[int], fields: Mapping[str, Any]) -> None:
        """Take the columns `inside` of a source; `fields` are the others of a `RowBlock`, and `summary`."""
        vars(self).update(fields)
        vars(self).update(source=source, inside=list(inside), whole=None)

    @property
    def in_memory(self) -> bool:
        """Whether its samples are kept, and not made again whenever asked for."""
        return isinstance(self.source, RowBlock) and self.source.in_memory

    @property
    def count(self) -> int:
        """Samples used."""
        return self.summary.count

    @property
    def place(self) -> IntArray:
        """Position of each sample on the grid, shape (n,)."""
        return self._whole().place

    @property
    def Y(self) -> FloatArray:
        """Left-hand side, shape (n,)."""
        return self._whole().Y

    @property
    def W(self) -> FloatArray:
        """Observation matrix, shape (n, columns)."""
        return self._whole().W

    def _whole(self) -> Stretch:
        if self.whole is not None:
            return self.whole
        found = self.between(0, self.grid)
        if self.in_memory:
            vars(self)["whole"] = found
        return found

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""
        return self._inside(self.source.between(start, stop))

    def residual(self, x: FloatArray) -> FloatArray:
        """Return Y - W x, shape (n,); x is in the order of all columns."""
        own = self.own(x)
        return np.concatenate([part.Y - part.W @ own for part in self.stretches()])

    def longest_run(self, most: int) -> Stretch:
        """Return the longest stretch without a gap, or so many of its first samples."""
        return self._inside(self.source.longest_run(most))

    def _inside(self, found: Stretch) -> Stretch:
        every = self.inside == list(range(found.W.shape[1]))
        return found if every else found._replace(W=found.W[:, self.inside])

    def kept(self) -> RowBlock:
        """Return the block with its samples in arrays of its own, whose fields can be replaced."""
        return RowBlock(**{field.name: getattr(self, field.name) for field in dataclass_fields(RowBlock)})


def runs_of(place: IntArray) -> list[IntArray]:
    """Return the indices of samples that are neighbours on the grid, gap by gap; `place` has shape (n,)."""
    return np.split(np.arange(len(place)), run_edges(place)[1:-1])


def run_edges(place: IntArray) -> IntArray:
    """Return where runs of neighbours begin among places of a grid, shape (n,), and last n."""
    # most rows leave nothing out: what stands between places is as long as these
    whole = len(place) == 0 or int(place[-1]) - int(place[0]) + 1 == len(place)
    inner = np.zeros(0, dtype=np.int64) if whole else np.flatnonzero(np.diff(place) != 1) + 1
    return np.concatenate([[0], inner, [len(place)]]).astype(np.int64)
