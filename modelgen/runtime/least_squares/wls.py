"""Weighted least squares (Pham 2002, eqs. (10)-(12)) on scaled columns, by orthogonal factorisation.

Every block (one row of the model on one record) has one weight, the inverse of its residual's rms. A load row
has a zero left-hand side and is solved by zeros: weighted like the others, it biases its parameters,
and re-weighting follows until they vanish. Its weight is therefore bounded by a share of what its first
residual, scaled by the forces, would give: enough to settle what the rows with a force leave open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, Problem
from modelgen.runtime.least_squares.fit import Fit, triangle_rows
from modelgen.runtime.least_squares.orthogonal_solution import least_squares, polished
from modelgen.runtime.least_squares.thresholds import (
    LOAD_ROW_SHARE,
    RUNAWAY_SHRINKAGE,
    SMALLEST_RESIDUAL,
    WEIGHTING_ROUNDS,
)
from modelgen.runtime.rows.observation import Observation, RowBlock

# Rows that are weighted at a time.
ROWS_A_PIECE = 1 << 17


def fit_matched(observation: Observation, load_row_share: float = LOAD_ROW_SHARE) -> Fit:
    """Fit matched-filtered rows: force-scaled start, weights from the residuals, load rows bounded.

    With a single block this is ordinary least squares.

    Raises
    ------
    IdentifiabilityError
        When no row with a force, or no more samples than columns, are left.
    """
    blocks, columns, absent = _used_with_force(observation)
    if len(blocks) == 1:
        return _solve(blocks, columns, absent, (1.0,))
    scales, c = _force_scales(blocks), len(columns)
    rms = _rms(blocks, _weighted(blocks, [1.0 / scale for scale in scales], c))
    smallest = [
        SMALLEST_RESIDUAL * scale if block.has_force else max(one / load_row_share, SMALLEST_RESIDUAL * scale)
        for block, scale, one in zip(blocks, scales, rms, strict=True)
    ]
    for _ in range(WEIGHTING_ROUNDS - 1):
        weights = tuple(1.0 / max(pair) for pair in zip(rms, smallest, strict=True))
        rms = _rms(blocks, _weighted(blocks, weights, c))
    weights = tuple(1.0 / max(pair) for pair in zip(rms, smallest, strict=True))
    fit = _solve(blocks, columns, absent, weights)
    return replace(fit, notes=_runaway_notes(fit, scales))


def fit_at(observation: Observation, start: Fit) -> Fit:
    """Return the rows of an observation with the solution of another fit, as a start for further rounds.

    Where these rows move other columns it is `fit_matched`; errors as there.
    """
    blocks, columns, absent = _used_with_force(observation)
    if columns != start.columns:
        return fit_matched(observation)
    residuals = tuple(block.residual(start.solution.x) for block in blocks)
    weights = (1.0,) * len(blocks)
    return Fit(columns, absent, start.solution, blocks, weights, residuals, simulated=start.simulated)


def fit_paper(observation: Observation) -> Fit:
    """Fit as the paper does: ordinary least squares, then one weight per block from its residual.

    With a single block this is ordinary least squares.
    """
    blocks, columns, absent = _used(observation)
    if len(blocks) == 1:
        return _solve(blocks, columns, absent, (1.0,))
    tiny = float(np.finfo(float).tiny)
    # rows of different orders differ by many powers of ten here: what rounding moves has to be undone
    rows = triangle_rows(blocks, [1.0] * len(blocks), len(columns))
    rms = _rms(blocks, least_squares(rows[:, :-1], rows[:, -1]).x)
    return _solve(blocks, columns, absent, tuple(1.0 / max(one, tiny) for one in rms))


def refit(fit: Fit, columns: Sequence[str]) -> Fit:
    """Fit the same rows with the same weights to some of the columns only."""
    blocks, projected = fit.rows(columns)
    return _solve(blocks, tuple(columns), fit.absent, fit.weights, projected)


def _used_with_force(
    observation: Observation,
) -> tuple[tuple[RowBlock, ...], tuple[str, ...], tuple[str, ...]]:
    """Return what `_used` does, where a force fixes the scale."""
    blocks, columns, absent = _used(observation)
    if not any(block.has_force for block in blocks):
        what = "none that holds a measured force has samples left, so nothing fixes the scale"
        raise IdentifiabilityError.at("rows", what, "measure a force, and move without reversing for longer")
    return blocks, columns, absent


def _used(observation: Observation) -> tuple[tuple[RowBlock, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the blocks with samples, reduced to the columns that are not zero, and both kinds of columns."""
    blocks = [block for block in observation.blocks if block.place.size]
    nonzero = np.zeros(len(observation.columns), dtype=bool)
    for block in blocks:
        touched = slice(None) if block.touched is None else block.touched
        nonzero[touched] |= np.any(block.W, axis=0)
    rows = sum(block.place.size for block in blocks)
    if not nonzero.any():
        what, remedy = "its column is zero in every sample used", "move the body, or mask less"
        raise IdentifiabilityError(*(Problem(name, what, remedy) for name in observation.columns))
    if rows <= nonzero.sum():
        what = f"{rows} samples are left for {len(nonzero)} columns"
        raise IdentifiabilityError.at(
            "records", what, "give longer records, with more motion between reversals"
        )
    columns = tuple(name for name, used in zip(observation.columns, nonzero, strict=True) if used)
    absent = tuple(name for name in observation.columns if name not in columns)
    if absent:
        kept = np.flatnonzero(nonzero).tolist()
        blocks = [block.chosen(kept) for block in blocks]
    return tuple(blocks), columns, absent


def _solve(
    blocks: tuple[RowBlock, ...],
    columns: tuple[str, ...],
    absent: tuple[str, ...],
    weights: tuple[float, ...],
    projected: tuple[FloatArray, ...] | None = None,
) -> Fit:
    c = len(columns)
    if projected is not None:
        R = np.concatenate([weight * array for weight, array in zip(weights, projected, strict=True)])
        Y = np.concatenate([weight * block.Y for weight, block in zip(weights, blocks, strict=True)])
        solution = least_squares(R, Y)
    else:
        triangle = np.asarray(np.linalg.qr(triangle_rows(blocks, weights, c), mode="r"))
        solution = polished(triangle, _Weighted(blocks, weights, c))
    residuals = tuple(block.residual(solution.x) for block in blocks)
    return Fit(columns, absent, solution, blocks, weights, residuals, (), projected)


class _Weighted(Sequence[tuple[FloatArray, FloatArray]]):
    """The weighted rows in pieces: all together they would be in memory twice."""

    def __init__(self, blocks: Sequence[RowBlock], weights: Sequence[float], columns: int) -> None:
        self._columns = columns
        self._pieces = [
            (weight, block, slice(start, start + ROWS_A_PIECE))
            for weight, block in zip(weights, blocks, strict=True)
            for start in range(0, len(block.Y), ROWS_A_PIECE)
        ]

    def __len__(self) -> int:
        return len(self._pieces)

    def __getitem__(self, index: Any) -> Any:
        weight, block, rows = self._pieces[index]
        piece = replace(block, W=block.W[rows], Y=block.Y[rows]).dense(self._columns)
        return weight * piece.W, weight * piece.Y


def _weighted(blocks: Sequence[RowBlock], weights: Sequence[float], columns: int) -> FloatArray:
    """Return the solution of the weighted rows, from the triangles of the blocks; good enough for weights."""
    triangle = np.asarray(np.linalg.qr(triangle_rows(blocks, weights, columns), mode="r"))
    return polished(triangle, ()).x


def _rms(blocks: Sequence[RowBlock], x: FloatArray) -> list[float]:
    """Return the rms of each block's residual."""
    return [block.residual_norm(x) / float(np.sqrt(block.place.size)) for block in blocks]


def _force_scales(blocks: tuple[RowBlock, ...]) -> list[float]:
    """Return for every block the rms over all records of the forces, differentiated as often as its row."""
    scale_of: dict[int, float] = {}
    for row in dict.fromkeys(block.row for block in blocks):
        alike = [block for block in blocks if block.row == row]
        samples = sum(block.grid for block in alike)
        power = sum(block.grid * block.force_scale**2 for block in alike)
        scale_of[row] = float(np.sqrt(power / samples)) or 1.0
    return [scale_of[block.row] for block in blocks]


def _runaway_notes(fit: Fit, scales: list[float]) -> tuple[str, ...]:
    """Return one note per load row whose terms would shrink if its weight were not bounded."""
    if all(block.has_force for block in fit.blocks):
        return ()
    freely = tuple(
        1.0 / max(rms, SMALLEST_RESIDUAL * scale)
        for rms, scale in zip(_rms(fit.blocks, fit.solution.x), scales, strict=True)
    )
    probe = _weighted(fit.blocks, freely, len(fit.columns))
    return tuple(
        f"{block.record_name}, row {block.row_name} holds no force and, weighted by its residual, would bias "
        "its parameters towards zero; its weight is bounded, but noise of the sensors biases what it decides"
        for block in fit.blocks
        if not block.has_force
        and block.terms_norm(probe) < RUNAWAY_SHRINKAGE * block.terms_norm(fit.solution.x)
    )
