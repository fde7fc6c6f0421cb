"""What least squares leave with an effect in one shape or another, and the shape that leaves least.

By least squares: a simulation without a resonance is far off about it, and so are instruments.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.effect_rows import effect_rows
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import (
    CLEARLY_LEFT,
    FEWEST_PERIODS,
    SAME_SHAPE,
    SEEN_AT_ALL,
    SHAPE_STEPS,
    SHAPES_TRIED,
    WEIGHTING_ROUNDS,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import joined_blocks
from modelgen.runtime.least_squares.wls import weighed_by_residuals
from modelgen.runtime.numerics.block_column import BlockColumn
from modelgen.runtime.numerics.qr_triangle import triangle_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.row_triangles import RowTriangle


@dataclass(frozen=True, eq=False)
class Left:
    """Minus the logarithm of the likelihood that is left, and sizes of effects."""

    misfit: float
    sizes: tuple[float, ...]

    @property
    def least(self) -> float:
        """The misfit; infinite where the first effect, which has one sign, has the other."""
        return self.misfit if self.sizes[0] > 0.0 else np.inf


@dataclass(frozen=True, eq=False)
class ShapeRows:
    """Rows of a fit whose effects are estimated by least squares.

    Attributes
    ----------
    fit : Fit
    setting : Setting
    simulated : sequence of Simulated
        With the fit's parameters.
    others : sequence of sequence of array
        How Y - W X grows with what is estimated already, in SI, shape (n,) a block each.
    """

    fit: Fit
    setting: Setting
    simulated: Sequence[Simulated]
    others: Sequence[Sequence[FloatArray]]

    @property
    def records(self) -> int:
        """How many there are."""
        return len(self.setting.records)

    @property
    def slowest_hz(self) -> float:
        """As `slowest_in` its records."""
        return slowest_in(self.setting.records)

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The misfits below which an effect is seen at all, and below which it is estimated."""
        whole, count = self.left(()).misfit, self.fit.count
        seen, clear = (whole + count * float(np.log(share)) for share in (SEEN_AT_ALL, CLEARLY_LEFT))
        return seen, clear

    @cached_property
    def _bases(self) -> tuple[_Base, ...]:
        return tuple(_Base(block) for block in joined_blocks(self.fit, self.others))

    def columns(self, effects: Sequence[Effect]) -> tuple[BlockColumn, ...]:
        """Return the columns of effects, (n,) a block each."""
        return effect_rows(self.fit, self.setting, self.simulated, effects)

    def left(self, columns: Sequence[BlockColumn]) -> Left:
        """Return what is left with further columns, each block weighted by what it leaves."""
        c, tiny, every = len(self.fit.columns), float(np.finfo(float).tiny), len(self.others) + len(columns)
        rows = [
            base.with_columns(np.column_stack([column[index] for column in columns]), every + c)
            if columns
            else base.block.summary
            for index, base in enumerate(self._bases)
        ]
        begun = [1.0 / weight for weight in self.fit.weights]
        x, rms = weighed_by_residuals(rows, begun, [tiny] * len(rows), WEIGHTING_ROUNDS, every + c)
        misfit = sum(
            block.count * float(np.log(np.sqrt(block.count) * max(left, tiny) / (block.size(x[:c]) or 1.0)))
            for block, left in zip(self.fit.blocks, rms, strict=True)
        )
        return Left(misfit, tuple(x[len(x) - len(columns) :].tolist()))

    def best_of(self, grid: Sequence[Effect], numbers: int) -> Iterator[Effect]:
        """Yield the shape with which clearly less is left, from the best of some on, if there is one."""
        seen, limit = self.limits
        at_grid = sorted(
            ((one, self.left(self.columns((one,))).least) for one in grid), key=lambda pair: pair[1]
        )
        begun = [one for one, misfit in at_grid[:SHAPES_TRIED] if misfit < seen]
        tried = [self.sharpened(one, numbers) for one in begun]
        best = min(tried, key=lambda pair: pair[1], default=None)
        if best is not None and best[1] < limit:
            yield best[0]

    def sharpened(self, effect: Effect, numbers: int) -> tuple[Effect, float]:
        """Return an effect in the shape that leaves least, by Gauss and Newton's steps, and the misfit.

        All but the first `numbers` of its shape are linear: free from the beginning.
        """
        best = self._begun(effect, numbers)
        for _ in range(SHAPE_STEPS):
            own, *linear = best.columns
            free = self.left((own, *self.columns(best.shape[:numbers]), *linear))
            moved = best.effect.moved
            if moved is None or not free.sizes[0] > 0.0:
                break
            # a shorter step where a long one leads too far
            tried = [moved(free.sizes[0], [by * step for step in free.sizes[1:]]) for by in (1.0, 0.3)]
            now = min((self._begun(one, numbers) for one in tried), key=lambda one: one.least)
            if now.least > best.least - SAME_SHAPE:
                break
            best = now
        return best.effect, best.least

    def _begun(self, effect: Effect, numbers: int) -> _Begun:
        shape = effect.shape(self.records)
        columns = self.columns((effect, *shape[numbers:]))
        return _Begun(effect, shape, columns, self.left(columns).least)


def slowest_in(records: Sequence[Record]) -> float:
    """Return the frequency in Hz below which the longest record holds too little of a period."""
    return FEWEST_PERIODS / max(record.duration_s for record in records)


def grid_hz(low: float, high: float, ratio: float) -> list[float]:
    """Return frequencies in Hz from one to another, each about so many times the one before."""
    count = max(2, round(float(np.log(high / low) / np.log(ratio))))
    return [float(hz) for hz in np.geomspace(low, high, count)]


@dataclass(frozen=True, eq=False)
class _Begun:
    """An effect in its shape, columns of what is linear in it, (n,) a block each, and what that leaves."""

    effect: Effect
    shape: tuple[Effect, ...]
    columns: tuple[BlockColumn, ...]
    least: float


class _Base:
    """A block, factorised once: columns behind its own are taken apart from these one shape after another."""

    def __init__(self, block: RowBlock) -> None:
        self.block, ones = block, np.ones((block.count, 1))
        self._Q, self._R = np.linalg.qr(np.hstack([ones, block.W]))

    def with_columns(self, extra: FloatArray, columns: int) -> RowTriangle:
        """Return the block with columns, shape (n, m), behind its own: the last of so many columns in all."""
        block, Q, k = self.block, self._Q, self._R.shape[1]
        behind = np.column_stack([extra, block.Y])
        along = Q.T @ behind
        apart = behind - Q @ along
        again = Q.T @ apart  # rounding leaves some of the columns
        along, apart = along + again, apart - Q @ again
        triangle = np.zeros((k + behind.shape[1],) * 2)
        triangle[: len(self._R), :k], triangle[: len(along), k:] = self._R, along
        triangle[k:, k:] = triangle_of(apart)
        m, touched = extra.shape[1], block.touched
        if touched is not None:
            touched = np.concatenate([touched, np.arange(columns - m, columns)])
        return replace(block.summary, triangle=triangle, touched=touched)
