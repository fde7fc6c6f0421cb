"""Fit: weighted rows, their solution and residuals; what every method makes of an observation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.joint_whitening import WhiteFit
from modelgen.runtime.least_squares.orthogonal_solution import LeastSquares
from modelgen.runtime.numerics.qr_triangle import joined_triangle, lines_of, tall_triangle
from modelgen.runtime.numerics.regressor import Regressor, Regressors
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock, Stretch
from modelgen.runtime.rows.row_triangles import misfit_of, triangle_rows


@dataclass(frozen=True, eq=False)
class CarriedOver:
    """Where a fit in base columns came from: a fit of physical parameters, linear at the estimate.

    Attributes
    ----------
    linear : Fit
        That fit, without bounds.
    series : tuple of array
        What each instant of each record adds to X's error, (grid, columns), by residuals of `linear`.
    unknown : tuple of str
        Physical parameters that cannot be told from the delays of forces.
    sizes : tuple of (float, float)
        Those of effects that were estimated as well, beyond what was taken off, and deviations.
    at : array, shape (p,), optional
        The physical parameters, SI, at which `linear` is linear: X is theirs.
    others : tuple of mappings
        Other physical parameters, SI, that fit as well.
    """

    linear: Fit
    series: tuple[FloatArray, ...]
    unknown: tuple[str, ...] = ()
    sizes: tuple[tuple[float, float], ...] = ()
    at: FloatArray | None = None
    others: tuple[Mapping[str, float], ...] = ()


class FittedStretch(NamedTuple):
    """A stretch of a block: its samples, what Y was regressed on, and Y - W x, shape (n,)."""

    part: Stretch
    regressor: Regressor
    residual: FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """A weighted least-squares fit of an observation, in SI; weighted rows are in SI times the weights.

    Attributes
    ----------
    columns : tuple of str
        Columns in the fit; `absent` are those that are zero in every row used.
    solution : LeastSquares
        In the order of `columns`, of the weighted rows.
    blocks : tuple of RowBlock
        The blocks used, with the columns of the fit; `weights` holds one weight each.
    residuals : sequence of array
        Unweighted Y - W X, one array a block; made anew of rows that are not kept: ask `residual_norms`.
    notes : tuple of str
        What the weighting met.
    projected : Regressors, optional
        What Y was regressed on in place of W: with instrumental variables their projection on W. None for
        least squares. Ask `regressors` or `between`, which are right for both.
    delays : tuple of (str, float, float)
        Of each force whose delay was estimated: its channel, by how many s it is late, and the standard
        deviation of that.
    lost : int
        Degrees of freedom that went into making the rows white, in addition to the columns.
    carried : CarriedOver, optional
        The fit of physical parameters that this one was carried over from; None where the columns were
        fitted themselves.
    simulated : mapping of int to Record, optional
        With instrumental variables the noise-free records that they were made of, by index of the record.
    series : tuple of array, optional
        What each instant of each record contributes to X's error, shape (grid, columns), where X comes from
        other weights of the same rows (`efficient`).
    white : WhiteFit, optional
        These weights, and what X and columns that are gone follow from with them.
    """

    columns: tuple[str, ...]
    absent: tuple[str, ...]
    solution: LeastSquares
    blocks: tuple[RowBlock, ...]
    weights: tuple[float, ...]
    residuals: Sequence[FloatArray]
    notes: tuple[str, ...] = ()
    projected: Regressors | None = None
    delays: tuple[tuple[str, float, float], ...] = ()
    lost: int = 0
    carried: CarriedOver | None = None
    simulated: Mapping[int, Record] | None = None
    series: tuple[FloatArray, ...] | None = None
    white: WhiteFit | None = None

    @property
    def regressors(self) -> Regressors:
        """What each block's Y was regressed on."""
        if self.projected is not None:
            return self.projected
        touched = tuple(block.touched for block in self.blocks)
        return Regressors(tuple(block.W for block in self.blocks), touched, None, len(self.columns))

    def dense(self) -> Fit:
        """Return the fit with every column in every block."""
        blocks = tuple(block.dense(len(self.columns)) for block in self.blocks)
        return replace(self, blocks=blocks, projected=self.projected and self.projected.dense())

    @cached_property
    def triangle(self) -> FloatArray:
        """R of the weighted [regressors Y], shape (c + 1, c + 1)."""
        if self.projected is None:
            return joined_triangle(triangle_rows(self.blocks, self.weights, len(self.columns)))
        return joined_triangle(regressed_rows(self.blocks, self.weights, self.projected))

    @cached_property
    def left_shares(self) -> tuple[float, ...]:
        """What each block leaves: the norm of its residual, as a share of that of its largest term."""
        return tuple(
            left / (block.terms_norm(self.solution.x) or 1.0)
            for block, left in zip(self.blocks, self.residual_norms, strict=True)
        )

    @property
    def misfit(self) -> float:
        """Minus the logarithm of the likelihood, each block with a noise of its own; see `misfit_of`."""
        return misfit_of(self.blocks, self.residual_norms, self.solution.x)

    @property
    def weighted_residual(self) -> FloatArray:
        """Weighted residual of all blocks, shape (r,), not to be changed."""
        found = np.empty(sum(block.count for block in self.blocks))
        start = 0
        for weight, residual in zip(self.weights, self.residuals, strict=True):
            np.multiply(weight, residual, out=found[start : start + len(residual)])
            start += len(residual)
        found.flags.writeable = False
        return found

    @property
    def weighted_measurement(self) -> FloatArray:
        """Weighted Y of all blocks, shape (r,)."""
        return np.concatenate([w * b.Y for w, b in zip(self.weights, self.blocks, strict=True)])

    @property
    def unknown(self) -> tuple[str, ...]:
        """Parameters, and forces whose delay, that the fit this was carried over from does not know."""
        return () if self.carried is None else self.carried.unknown

    def physical(self, names: Sequence[str]) -> dict[str, float] | None:
        """Return the physical parameters of the fit that this was carried over from, None without one.

        What bounds hold at zero may be negative here.
        """
        if self.carried is None:
            return None
        return dict(zip(names, self.carried.linear.all_parameters(names).tolist(), strict=True))

    def rows(self, columns: Sequence[str]) -> tuple[tuple[RowBlock, ...], Regressors | None]:
        """Return blocks, and what Y was regressed on in place of W, of some columns."""
        chosen = [self.columns.index(name) for name in columns]
        blocks = tuple(block.chosen(chosen) for block in self.blocks)
        return blocks, None if self.projected is None else self.projected.chosen(chosen)

    def all_parameters(self, names: Sequence[str]) -> FloatArray:
        """Return the solution by these names, shape (names,), zero for those that are no columns.

        The array is not to be changed.
        """
        key = tuple(names)
        if key not in self._named:
            values = dict(zip(self.columns, self.solution.x.tolist(), strict=True))
            self._named[key] = np.array([values.get(name, 0.0) for name in key])
            self._named[key].flags.writeable = False
        return self._named[key]

    @cached_property
    def _named(self) -> dict[tuple[str, ...], FloatArray]:
        """What `all_parameters` has returned: every row of a long chain asks for the same."""
        return {}

    @property
    def relative_error(self) -> float:
        """Norm of Y - W X relative to that of Y, of the largest term of rows without a force; weighted.

        It lies between the smallest and the largest of the rows' own.
        """
        compared = _norm(self.weights, [block.size(self.solution.x) for block in self.blocks])
        return self.residual_norm / compared if compared > 0.0 else np.inf

    @property
    def residual_norm(self) -> float:
        """Norm of the weighted residual of all blocks."""
        return _norm(self.weights, self.residual_norms)

    @cached_property
    def residual_norms(self) -> tuple[float, ...]:
        """Norm of each block's residual, not weighted."""
        return tuple(
            float(np.linalg.norm(self.residuals[index]))
            if block.in_memory
            else block.summary.residual_norm(self.solution.x)
            for index, block in enumerate(self.blocks)
        )

    def rms(self, index: int) -> float:
        """Return the rms of a block's residual, not weighted."""
        return self.residual_norms[index] / float(np.sqrt(self.blocks[index].count))

    def unexplained(self, index: int) -> float | None:
        """Return what share of its force a block leaves, or of its largest term; None where that is zero."""
        size = self.blocks[index].size(self.solution.x)
        return self.residual_norms[index] / size if size > 0.0 else None

    @property
    def by_record(self) -> dict[int, list[int]]:
        """Which blocks are of each record."""
        found: dict[int, list[int]] = {}
        for index, block in enumerate(self.blocks):
            found.setdefault(block.record, []).append(index)
        return found

    @property
    def count(self) -> int:
        """Samples used in all blocks."""
        return sum(block.count for block in self.blocks)

    @property
    def turning(self) -> bool:
        """Whether some block uses samples that feel a reversal, as few others are left."""
        return any(block.turning for block in self.blocks)

    def between(self, index: int, start: int, stop: int) -> FittedStretch:
        """Return the samples of a block that are used among those points of the grid."""
        return self.fitted(index, self.blocks[index].between(start, stop))

    def fitted(self, index: int, part: Stretch) -> FittedStretch:
        """Return what a stretch of a block was regressed on, and what it leaves."""
        block = self.blocks[index]
        if self.projected is not None:
            regressor = self.projected[index].within(part.rows)
        else:
            regressor = Regressor(part.W, block.touched, None, len(self.columns))
        if block.in_memory:
            return FittedStretch(part, regressor, self.residuals[index][part.rows])
        return FittedStretch(part, regressor, part.Y - part.W @ block.own(self.solution.x))

    def touched(self, index: int) -> IntArray:
        """Return the places of a block's columns among those of the fit, shape (k,)."""
        touched = self.blocks[index].touched
        return np.arange(len(self.columns)) if touched is None else touched


def residuals_of(blocks: Sequence[RowBlock], x: FloatArray) -> Sequence[FloatArray]:
    """Return Y - W x of each block, in its unit, (n,); of rows that are not kept made when asked for."""
    if all(block.in_memory for block in blocks):
        return tuple(block.residual(x) for block in blocks)
    return _RemadeResiduals(blocks, x)


class _RemadeResiduals(Sequence[FloatArray]):
    def __init__(self, blocks: Sequence[RowBlock], x: FloatArray) -> None:
        self._blocks, self._x = blocks, x

    def __len__(self) -> int:
        return len(self._blocks)

    def __getitem__(self, index: Any) -> Any:
        return self._blocks[index].residual(self._x)


def _norm(weights: Sequence[float], norms: Sequence[float]) -> float:
    """Return the norm of weighted parts together."""
    return float(np.linalg.norm([weight * norm for weight, norm in zip(weights, norms, strict=True)]))


def regressed_rows(
    blocks: Sequence[RowBlock], weights: Sequence[float], regressors: Regressors
) -> list[FloatArray]:
    """Return rows as good as a block's weighted [regressors Y], SI times weights, (few, columns + 1) each."""
    found = []
    for weight, one, block in zip(weights, regressors, blocks, strict=True):
        lines = weight * lines_of(tall_triangle(one.samples, block.Y)[:, 1:])
        found.append(np.column_stack([one.lines(lines[:, :-1]), lines[:, -1]]))
    return found
