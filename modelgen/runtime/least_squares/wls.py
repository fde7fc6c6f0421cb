"""Weighted least squares (Pham 2002, eqs. (10)-(12)) on scaled columns, by orthogonal factorisation.

Every block (one row of the model on one record) has one weight, the inverse of its residual's rms. A load row
has a zero left-hand side and is solved by zeros: weighted like the others, it biases its parameters,
and re-weighting follows until they vanish. Its weight is therefore bounded by a share of what its first
residual, scaled by the forces, would give: enough to settle what the rows with a force leave open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, Problem
from modelgen.runtime.least_squares.fit import Fit, regressed_rows, residuals_of
from modelgen.runtime.least_squares.orthogonal_solution import (
    LeastSquares,
    least_squares,
    polished,
    rough_solution,
)
from modelgen.runtime.least_squares.thresholds import (
    ALIKE,
    LOAD_ROW_SHARE,
    RUNAWAY_SHRINKAGE,
    SMALLEST_RESIDUAL,
    WEIGHTING_ROUNDS,
)
from modelgen.runtime.numerics.qr_triangle import joined_triangle
from modelgen.runtime.numerics.regressor import Regressor, Regressors, WeightedPieces
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import STRETCH, RowBlock
from modelgen.runtime.rows.row_triangles import RowTriangle, triangle_rows

Part = TypeVar("Part", RowBlock, RowTriangle)


def fit_matched(
    observation: Observation,
    load_row_share: float = LOAD_ROW_SHARE,
    polish: bool = True,
    further: Sequence[str] = (),
) -> Fit:
    """Fit matched-filtered rows: force-scaled start, weights from the residuals, load rows bounded.

    With a single block this is ordinary least squares. Without `polish` what rounding has moved stays in.
    Load rows are bounded by their first residual without `further` columns where that is smaller.

    Raises
    ------
    IdentifiabilityError
        When no row with a force, or no more samples than columns, are left.
    """
    blocks, columns, absent = _used_with_force(observation.blocks, observation.columns)
    plain = [place for place, name in enumerate(columns) if name not in further]
    weights, scales = _matched_weights([one.summary for one in blocks], len(columns), load_row_share, plain)
    fit = _solve(blocks, columns, absent, weights, polish=polish)
    return replace(fit, notes=_runaway_notes(fit, scales))


@dataclass(frozen=True, eq=False)
class MatchedSolution:
    """What `fit_matched` finds, with triangles in place of the rows used: the columns, and their solution."""

    columns: tuple[str, ...]
    solution: LeastSquares
    rows: tuple[RowTriangle, ...]


def solve_matched(
    rows: Sequence[RowBlock | RowTriangle], names: Sequence[str], load_row_share: float = LOAD_ROW_SHARE
) -> MatchedSolution:
    """Return the solution of `fit_matched` from the triangles of the rows; `names` are those of all columns.

    Raises
    ------
    IdentifiabilityError
        As `fit_matched`.
    """
    used, columns, _ = _used_with_force([row.summary for row in rows], names)
    weights, _ = _matched_weights(used, len(columns), load_row_share)
    solution = polished(_triangle(used, weights, len(columns)), (), alike=ALIKE)
    return MatchedSolution(columns, solution, used)


def _matched_weights(
    rows: Sequence[RowTriangle], c: int, load_row_share: float, plain: Sequence[int] | None = None
) -> tuple[tuple[float, ...], list[float]]:
    """Return the weights of the rows, and the size of the forces that each balances; see `fit_matched`."""
    scales = _force_scales(rows)
    if len(rows) == 1:
        return (1.0,), scales
    equal = [1.0 / scale for scale in scales]
    rms: Sequence[float] = _rms(rows, rough_solution(_triangle(rows, equal, c)))
    first = rms
    if plain is not None and len(plain) < c:
        fewer = [row.chosen(plain) for row in rows]
        first = np.minimum(rms, _rms(fewer, rough_solution(_triangle(fewer, equal, len(plain))))).tolist()
    smallest = [
        SMALLEST_RESIDUAL * scale if row.has_force else max(one / load_row_share, SMALLEST_RESIDUAL * scale)
        for row, scale, one in zip(rows, scales, first, strict=True)
    ]
    _, rms = weighed_by_residuals(rows, rms, smallest, WEIGHTING_ROUNDS - 1, c)
    return tuple(1.0 / max(pair) for pair in zip(rms, smallest, strict=True)), scales


def weighed_by_residuals(
    rows: Sequence[RowTriangle], rms: Sequence[float], smallest: Sequence[float], rounds: int, columns: int
) -> tuple[FloatArray, Sequence[float]]:
    """Return X, in SI, shape (columns,), and the rms residual of each row, which the next round weighs it by.

    `rms`, in the unit of the row, are those to begin with, and none counts as less than `smallest`.
    """
    x = np.zeros(columns)
    for _ in range(rounds):
        weights = [1.0 / max(pair) for pair in zip(rms, smallest, strict=True)]
        x = rough_solution(_triangle(rows, weights, columns))
        rms = _rms(rows, x)
    return x, rms


def fit_at(observation: Observation, start: Fit) -> Fit:
    """Return the rows of an observation with the solution of another fit, as a start for further rounds.

    Where these rows move other columns it is `fit_matched`; errors as there.
    """
    blocks, columns, absent = _used_with_force(observation.blocks, observation.columns)
    if columns != start.columns:
        return fit_matched(observation)
    residuals = residuals_of(blocks, start.solution.x)
    weights = (1.0,) * len(blocks)
    return Fit(columns, absent, start.solution, blocks, weights, residuals, simulated=start.simulated)


def fit_from(observation: Observation, x: FloatArray) -> Fit:
    """Return `fit_matched` with another solution, of all columns of the observation, in SI, (columns,)."""
    fit = fit_matched(observation)
    own = np.asarray(x)[[observation.columns.index(name) for name in fit.columns]]
    return replace(fit, solution=replace(fit.solution, x=own), residuals=residuals_of(fit.blocks, own))


def fit_paper(observation: Observation) -> Fit:
    """Fit as the paper does: ordinary least squares, then one weight per block from its residual.

    With a single block this is ordinary least squares.
    """
    blocks, columns, absent = _used(observation.blocks, observation.columns)
    if len(blocks) == 1:
        return _solve(blocks, columns, absent, (1.0,))
    tiny = float(np.finfo(float).tiny)
    # rows of different orders differ by many powers of ten here: what rounding moves has to be undone
    rows = np.concatenate(triangle_rows(blocks, [1.0] * len(blocks), len(columns)))
    rms = _rms([block.summary for block in blocks], least_squares(rows[:, :-1], rows[:, -1]).x)
    return _solve(blocks, columns, absent, tuple(1.0 / max(one, tiny) for one in rms))


def refit(fit: Fit, columns: Sequence[str], polish: bool = True) -> Fit:
    """Fit the same rows with the same weights to some of the columns only.

    Without `polish` what rounding has moved stays in, which is enough to see what a column is worth.
    """
    blocks, projected = fit.rows(columns)
    return _solve(blocks, tuple(columns), fit.absent, fit.weights, projected, polish)


def _used_with_force(
    rows: Sequence[Part], names: Sequence[str]
) -> tuple[tuple[Part, ...], tuple[str, ...], tuple[str, ...]]:
    """Return what `_used` does, where a force fixes the scale."""
    used, columns, absent = _used(rows, names)
    if not any(row.has_force for row in used):
        what = "none that holds a measured force has samples left, so nothing fixes the scale"
        raise IdentifiabilityError.at("rows", what, "measure a force, and move without reversing for longer")
    if not any(row.has_force and row.summary.measured_norm > 0.0 for row in used):
        what = "hold the gains of all drives, which are to be found: nothing says how large a force is"
        remedy = (
            "measure a force, or give one gain or parameter in [known]; or record the arm with a payload of "
            "known mass as well ([payload.NAME] with mass in its file, --payload RECORD=NAME)"
        )
        raise IdentifiabilityError.at("rows", what, remedy)
    return used, columns, absent


def _used(
    rows: Sequence[Part], names: Sequence[str]
) -> tuple[tuple[Part, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the rows with samples, reduced to the columns that are not zero, and both kinds of columns."""
    used = [row for row in rows if row.summary.count]
    nonzero = np.zeros(len(names), dtype=bool)
    for row in used:
        touched = slice(None) if row.touched is None else row.touched
        nonzero[touched] |= np.any(row.summary.triangle[:, 1:-1], axis=0)
    count = sum(row.summary.count for row in used)
    if not count:
        what = "no sample is left: rest or a change of direction is within the filters' reach of every one"
        remedy = "move for longer without reversing, or give a higher cut-off"
        raise IdentifiabilityError.at("records", what, remedy)
    if not nonzero.any():
        what, remedy = "its column is zero in every sample used", "move the body, or mask less"
        raise IdentifiabilityError(*(Problem(name, what, remedy) for name in names))
    if count <= nonzero.sum():
        what = f"{count} samples are left for {len(nonzero)} columns"
        raise IdentifiabilityError.at(
            "records", what, "give longer records, with more motion between reversals"
        )
    columns = tuple(name for name, moved in zip(names, nonzero, strict=True) if moved)
    absent = tuple(name for name in names if name not in columns)
    if absent:
        kept = np.flatnonzero(nonzero).tolist()
        used = [row.chosen(kept) for row in used]
    return tuple(used), columns, absent


def _solve(
    blocks: tuple[RowBlock, ...],
    columns: tuple[str, ...],
    absent: tuple[str, ...],
    weights: tuple[float, ...],
    projected: Regressors | None = None,
    polish: bool = True,
) -> Fit:
    c = len(columns)
    parts: Sequence[tuple[Regressor, FloatArray]]
    if projected is not None:
        rows = regressed_rows(blocks, weights, projected)
        parts = WeightedPieces(projected, tuple(block.Y for block in blocks), weights)
    else:
        rows, parts = triangle_rows(blocks, weights, c), _Weighted(blocks, weights, c)
    triangle = joined_triangle(rows)
    solution = polished(triangle, parts if polish else (), alike=ALIKE)
    residuals = residuals_of(blocks, solution.x)
    return Fit(columns, absent, solution, blocks, weights, residuals, (), projected)


class _Weighted(Sequence[tuple[Regressor, FloatArray]]):
    """The weighted rows in pieces: all together they would be in memory twice.

    The rows of a record follow each other stretch by stretch: those that are not kept are made together.
    """

    def __init__(self, blocks: Sequence[RowBlock], weights: Sequence[float], columns: int) -> None:
        self._columns = columns
        pieces = [
            (block.record, start, weight, block)
            for weight, block in zip(weights, blocks, strict=True)
            for start in range(0, block.grid, STRETCH)
        ]
        self._pieces = sorted(pieces, key=lambda piece: piece[:2])

    def __len__(self) -> int:
        return len(self._pieces)

    def __getitem__(self, index: Any) -> Any:
        _, start, weight, block = self._pieces[index]
        part = block.between(start, start + STRETCH)
        return Regressor(weight * part.W, block.touched, None, self._columns), weight * part.Y


def _triangle(rows: Sequence[RowTriangle], weights: Sequence[float], columns: int) -> FloatArray:
    """Return the triangle of the weighted rows, from their own."""
    return joined_triangle(triangle_rows(rows, weights, columns))


def _rms(rows: Sequence[RowTriangle], x: FloatArray) -> list[float]:
    """Return the rms of each row's residual, over what is left of its samples where forces are open."""
    return [row.residual_norm(x) / float(np.sqrt(max(row.count - row.opened, 1.0))) for row in rows]


def _force_scales(blocks: Sequence[RowTriangle]) -> list[float]:
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
    if len(fit.blocks) == 1 or all(block.has_force for block in fit.blocks):
        return ()
    rows = [block.summary for block in fit.blocks]
    freely = tuple(
        1.0 / max(rms, SMALLEST_RESIDUAL * scale)
        for rms, scale in zip(_rms(rows, fit.solution.x), scales, strict=True)
    )
    probe = rough_solution(_triangle(rows, freely, len(fit.columns)))
    return tuple(
        f"{block.record_name}, row {block.row_name} holds no force and, weighted by its residual, would bias "
        "its parameters towards zero; its weight is bounded, but noise of the sensors biases what it decides"
        for block in fit.blocks
        if not block.has_force
        and block.terms_norm(probe) < RUNAWAY_SHRINKAGE * block.terms_norm(fit.solution.x)
    )
