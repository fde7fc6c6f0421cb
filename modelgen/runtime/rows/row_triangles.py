"""Triangles in place of rows: all that weights and the solution of least squares ask, in constant memory.

A fit at other settings is wanted for its solution only. Its rows are made chunk by chunk and taken into one
triangle of [1 W Y] for every row of the model and record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.qr_triangle import lines_of, tall_triangle, triangle_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.masks import Survey
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.row_terms import holds_force, holds_gain

if TYPE_CHECKING:
    from modelgen.runtime.rows.row_block import RowBlock

# Triangles that are kept until they are joined: all of them would grow with the record.
AT_A_TIME = 16


@dataclass(frozen=True, eq=False)
class RowTriangle:
    """What the samples of one row of the model on one record come to, in SI.

    Attributes
    ----------
    record, row, grid, has_force, force_scale, touched, by_gain
        As of `modelgen.runtime.rows.observation.RowBlock`.
    count : int
        Samples used.
    triangle : array, shape (k + 2, k + 2)
        R of [1 W Y], W of k columns.
    opened : float
        Directions of which nothing is left where forces are open.
    """

    record: int
    row: int
    count: int
    grid: int
    has_force: bool
    force_scale: float
    triangle: FloatArray
    touched: IntArray | None = None
    by_gain: bool = False
    opened: float = 0.0

    @property
    def summary(self) -> RowTriangle:
        """Itself: what a block of rows has, too."""
        return self

    def own(self, x: FloatArray) -> FloatArray:
        """Return the entries that belong to the columns of W, of an array of shape (columns, ...)."""
        return x if self.touched is None else np.asarray(x[self.touched])

    def residual_norm(self, x: FloatArray) -> float:
        """Return the norm of Y - W x; x is in the order of all columns, shape (columns,)."""
        return float(np.linalg.norm(self.triangle[:, -1] - self.triangle[:, 1:-1] @ self.own(x)))

    def terms_norm(self, x: FloatArray) -> float:
        """Return the norm of the largest term W_j x_j about its mean: the size of what the row balances.

        x is in the order of all columns, shape (columns,).
        """
        spread = np.linalg.norm(self.triangle[1:, 1:-1], axis=0)
        return float(np.max(spread * np.abs(self.own(x)), initial=0.0))

    def size(self, x: FloatArray) -> float:
        """Return the norm that a residual is compared with: of Y, of the largest term without a force in it.

        x is in the order of all columns, shape (columns,).
        """
        in_measurement = self.has_force and not self.by_gain
        return self.measured_norm if in_measurement else self.terms_norm(x)

    @property
    def measured_norm(self) -> float:
        """Norm of Y."""
        return float(np.linalg.norm(self.triangle[:, -1]))

    def chosen(self, columns: Sequence[int]) -> RowTriangle:
        """Return the same with these of all columns only, in their order."""
        every = range(self.triangle.shape[1] - 2) if self.touched is None else self.touched
        place = {int(column): index for index, column in enumerate(every)}
        kept = [index for index, column in enumerate(columns) if column in place]
        inside = [place[columns[index]] + 1 for index in kept]
        triangle = triangle_of(self.triangle[:, [0, *inside, -1]])
        return replace(self, triangle=triangle, touched=np.array(kept, dtype=np.int64))

    def about_constant(self, place: int) -> RowTriangle:
        """Return the same with a constant as a further column, the one at `place` behind all others."""
        ones, own = self.triangle[:, [0]], self.triangle[:, :-1]
        columns = np.arange(own.shape[1] - 1) if self.touched is None else self.touched
        triangle = triangle_of(np.hstack([own, ones, self.triangle[:, -1:]]))
        return replace(self, triangle=triangle, touched=np.append(columns, place))


def misfit_of(
    rows: Sequence[RowBlock | RowTriangle], residual_norms: Sequence[float], x: FloatArray
) -> float:
    """Return minus the logarithm of the likelihood of a solution, each row with a noise of its own.

    Residuals count as shares of the measured forces, or of what rows without a force balance: parameters
    that shrink a row explain nothing, nor do terms that grow and cancel each other. x is in the order of all
    columns, shape (columns,).
    """
    tiny = float(np.finfo(float).tiny)
    return sum(
        row.summary.count * float(np.log(max(left / (row.summary.size(x) or 1.0), tiny)))
        for row, left in zip(rows, residual_norms, strict=True)
    )


def observe_triangles(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int = 0,
    surveys: Sequence[Survey] = (),
) -> list[RowTriangle]:
    """Return the triangles of the rows that `observe` makes of the records, samples at turns included.

    Parameters and errors are those of `modelgen.runtime.rows.observation.observe`.
    """
    found: list[RowTriangle] = []
    for index, record in enumerate(records):
        survey = surveys[index] if surveys else None
        rows = matched_rows(model, record, choice, choice.decimation[index], drop, survey=survey)
        found += row_triangles(rows, index)
    return found


def row_triangles(rows: RecordRows, index: int) -> list[RowTriangle]:
    """Return the triangles of the rows of one record, the `index`-th, whose masks look at chunks alone."""
    return triangles_and_masks(rows, index)[0]


class Used(NamedTuple):
    """Which samples of a chunk a row uses: how many, and a packed bit for each; None where all are."""

    samples: int
    bits: npt.NDArray[np.uint8] | None


def triangles_and_masks(
    rows: RecordRows, index: int
) -> tuple[list[RowTriangle], tuple[tuple[Used, ...], ...]]:
    """Return the same, and for every row which samples of each chunk it uses."""

    def of(chunk: Chunk) -> tuple[list[tuple[Used, FloatArray]], dict[int, float]]:
        signals, found = chunk.signals(), []
        for terms, mask in zip(rows.terms, rows.masks, strict=True):
            lines = terms.evaluate(signals)
            signals.forget(terms.row)
            masked = mask.of(chunk, rows.survey.thresholds)
            bits = np.packbits(~masked) if masked.any() else None
            lines = lines if bits is None else lines[:, ~masked]
            found.append((Used(lines.shape[1], bits), tall_triangle(lines[:-1].T, lines[-1])))
        return found, signals.force_power

    taken = [_TakenRow() for _ in rows.terms]
    total: dict[int, float] = {}
    for part, power in rows.over_chunks(of):
        for one, (used, triangle) in zip(taken, part, strict=True):
            one.take(used, triangle)
        for times, more in power.items():
            total[times] = total.get(times, 0.0) + more
    grid, model, found = len(rows.grid), rows.plan.model, []
    for terms, info, one in zip(rows.terms, model.rows, taken, strict=True):
        count, triangle = sum(used.samples for used in one.used), one.triangle()
        scale = float(np.sqrt(total.get(info.differentiated, 0.0) / grid)) / info.lever
        measured = float(np.linalg.norm(triangle[:, -1]))
        has_force = holds_force(model, terms.row, measured, scale * np.sqrt(count))
        touched, by_gain = np.array(terms.columns, dtype=np.int64), holds_gain(model, terms.row)
        found.append(RowTriangle(index, terms.row, count, grid, has_force, scale, triangle, touched, by_gain))
    return found, tuple(tuple(one.used) for one in taken)


class _TakenRow:
    """One row of a record, chunk by chunk: what is used of it, and triangles, few at a time."""

    def __init__(self) -> None:
        self.used: list[Used] = []
        self._triangles: list[FloatArray] = []

    def take(self, used: Used, triangle: FloatArray) -> None:
        """Take in a chunk: what is used, and its triangle, shape (k + 2, k + 2)."""
        self.used.append(used)
        self._triangles.append(triangle)
        if len(self._triangles) == AT_A_TIME:
            self._triangles = [self.triangle()]

    def triangle(self) -> FloatArray:
        """Return the triangle of all chunks, shape (k + 2, k + 2)."""
        return triangle_of(np.concatenate(self._triangles))


def triangle_rows(
    blocks: Sequence[RowBlock | RowTriangle], weights: Sequence[float], columns: int
) -> list[FloatArray]:
    """Return rows as good as the weighted [W Y] of each block, SI times weights, (few, columns + 1) each."""
    parts = []
    for weight, block in zip(weights, blocks, strict=True):
        rows = weight * lines_of(block.triangle[:, 1:])
        if block.touched is not None:
            wide = np.zeros((len(rows), columns + 1))
            wide[:, [*block.touched, columns]] = rows
            rows = wide
        parts.append(rows)
    return parts
