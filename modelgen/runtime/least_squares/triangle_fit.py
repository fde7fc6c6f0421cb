"""The fit of `wls`, asked of triangles instead of rows: whatever the length of the records.

Whatever a round of re-weighting needs is in the triangles; only the last one, of all rows together, is new in
each round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.least_squares.wls import (
    LOAD_ROW_SHARE,
    ROUNDS,
    RUNAWAY_SHRINKAGE,
    SMALLEST_RESIDUAL,
    least_squares,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.banded_least_squares import solve_banded
from modelgen.runtime.rows.observation import LEAST_FORCE
from modelgen.runtime.rows.record_factors import RecordFactors
from modelgen.runtime.rows.row_factor import RowFactor

FloatArray = npt.NDArray[np.float64]
Key = tuple[int, int]  # record and row

# From so many columns the banded solution is used; below, all singular values are looked at.
BANDED_COLUMNS = 40
# Up to so many columns a whole inverse is no matter: (W^T W)^-1 takes a megabyte.
MOST_COLUMNS = 400


@dataclass(frozen=True, eq=False)
class FactorFit:
    """Weighted least squares of the triangles of records.

    Attributes
    ----------
    columns : tuple of int
        Base parameters in the fit; the others' columns are zero in every sample used.
    x : array, shape (base parameters,)
        Zero where not in the fit.
    inverse : array or None
        (W^T W)^-1 of the weighted rows, shape (columns, columns); None where only its diagonal was computed.
    variance : array, shape (columns,)
        Its diagonal.
    undetermined : array of bool, shape (columns,)
        Columns that the rows cannot tell from others.
    condition_number, condition_number_raw : float
        Of W with columns of unit length, and as they are; nan for the banded solution.
    weights : dict of (record, row) to float
    rms : dict of (record, row) to float
        Of the unweighted residual.
    samples : int
        Rows of W.
    residual_norm, measured_norm : float
        Norms of Y - W X and Y, both weighted.
    loads : tuple of (record, row)
        Rows that hold no force: their weight is bounded.
    runaways : tuple of (record, row)
        Those among them that would pull their parameters towards zero if it were not.
    """

    columns: tuple[int, ...]
    x: FloatArray
    inverse: FloatArray | None
    variance: FloatArray
    undetermined: npt.NDArray[np.bool_]
    condition_number: float
    condition_number_raw: float
    weights: dict[Key, float]
    rms: dict[Key, float]
    samples: int
    residual_norm: float
    measured_norm: float
    loads: tuple[Key, ...]
    runaways: tuple[Key, ...]

    @property
    def sigma(self) -> float:
        """Standard deviation of the weighted residual, eq. (11)."""
        return self.residual_norm / float(np.sqrt(self.samples - len(self.columns)))

    @property
    def relative_error(self) -> float:
        """Norm of Y - W X relative to that of Y, both weighted."""
        return self.residual_norm / self.measured_norm if self.measured_norm > 0.0 else np.inf


@dataclass(frozen=True, eq=False)
class _Solution:
    x: FloatArray
    inverse: FloatArray | None
    variance: FloatArray
    undetermined: npt.NDArray[np.bool_]
    condition_number: float
    condition_number_raw: float


def fit_factors(
    model: Model,
    records: Sequence[RecordFactors],
    banded: bool | None = None,
    load_row_share: float = LOAD_ROW_SHARE,
) -> FactorFit:
    """Fit as `wls.fit_matched` does: force-scaled start, weights from the residuals, load rows bounded.

    Parameters
    ----------
    model : Model
    records : sequence of RecordFactors
    banded : bool, optional
        Whether to use the banded solution; by default where there are many columns.
    load_row_share : float
        Weight of a row without a force, as a share of what its first residual gives.

    Raises
    ------
    IdentifiabilityError
        When no row with a force, or no more samples than columns, are left.
    """
    blocks = {
        (index, factor.row): factor
        for index, record in enumerate(records)
        for factor in record.rows
        if factor.samples
    }

    def own_scale(key: Key) -> float:
        return records[key[0]].force_scale(model.rows[key[1]])

    scales = _force_scales(model, records, blocks)
    forced = {
        key: block.force_norm > LEAST_FORCE * own_scale(key) * np.sqrt(block.samples)
        for key, block in blocks.items()
    }
    columns = _columns(model, blocks)
    samples = sum(block.samples for block in blocks.values())
    if not any(forced.values()):
        what = "none that holds a measured force has samples left, so nothing fixes the scale"
        raise IdentifiabilityError.at("rows", what, "measure a force, and move without reversing for longer")
    if not columns or samples <= len(columns):
        what = f"{samples} samples are left for {len(columns)} columns that are not zero"
        raise IdentifiabilityError.at(
            "records", what, "give longer records, with more motion between reversals"
        )
    use_band = len(columns) >= BANDED_COLUMNS if banded is None else banded
    triangles = {key: block.triangle for key, block in blocks.items()}

    def solve(weights: dict[Key, float]) -> _Solution:
        return _solve(blocks, triangles, weights, columns, len(model.base_parameters), use_band)

    def rms(solution: _Solution) -> dict[Key, float]:
        return {key: block.residual_rms(solution.x) for key, block in blocks.items()}

    weights = {key: 1.0 / scales[key] for key in blocks} if len(blocks) > 1 else dict.fromkeys(blocks, 1.0)
    solution = solve(weights)
    if len(blocks) > 1:
        first = rms(solution)
        least = {
            key: max(0.0 if forced[key] else first[key] / load_row_share, SMALLEST_RESIDUAL * scales[key])
            for key in blocks
        }
        for _ in range(ROUNDS):
            weights = {key: 1.0 / max(value, least[key]) for key, value in rms(solution).items()}
            solution = solve(weights)
    loads = tuple(key for key in blocks if not forced[key])
    runaways: list[Key] = []
    if loads and len(blocks) > 1:
        smallest = {key: SMALLEST_RESIDUAL * scale for key, scale in scales.items()}
        probe = solve({key: 1.0 / max(value, smallest[key]) for key, value in rms(solution).items()})
        shrunk = {key: blocks[key].terms_norm(probe.x) for key in loads}
        runaways += [k for k in loads if shrunk[k] < RUNAWAY_SHRINKAGE * blocks[k].terms_norm(solution.x)]
    found = rms(solution)
    squares = sum(blocks[key].samples * (weights[key] * found[key]) ** 2 for key in blocks)
    measured = sum((weights[key] * block.force_norm) ** 2 for key, block in blocks.items())
    return FactorFit(
        columns,
        solution.x,
        solution.inverse,
        solution.variance,
        solution.undetermined,
        solution.condition_number,
        solution.condition_number_raw,
        weights,
        found,
        samples,
        float(np.sqrt(squares)),
        float(np.sqrt(measured)),
        loads,
        tuple(runaways),
    )


def refit_factors(records: Sequence[RecordFactors], fit: FactorFit, columns: Sequence[int]) -> FactorFit:
    """Return the fit of the same weighted rows to some of its columns, with the whole inverse."""
    blocks = {
        (index, factor.row): factor
        for index, record in enumerate(records)
        for factor in record.rows
        if (index, factor.row) in fit.weights
    }
    triangles = {key: block.triangle for key, block in blocks.items()}
    solution = _solve(blocks, triangles, fit.weights, tuple(columns), len(fit.x), banded=False)
    rms = {key: block.residual_rms(solution.x) for key, block in blocks.items()}
    squares = sum(blocks[key].samples * (fit.weights[key] * rms[key]) ** 2 for key in blocks)
    return replace(
        fit,
        columns=tuple(columns),
        x=solution.x,
        inverse=solution.inverse,
        variance=solution.variance,
        undetermined=solution.undetermined,
        condition_number=solution.condition_number,
        condition_number_raw=solution.condition_number_raw,
        rms=rms,
        residual_norm=float(np.sqrt(squares)),
    )


def with_inverse(records: Sequence[RecordFactors], fit: FactorFit) -> FactorFit:
    """Return the fit with its whole inverse, which the covariance needs, unless that would be too large."""
    if fit.inverse is not None or len(fit.columns) > MOST_COLUMNS:
        return fit
    return refit_factors(records, fit, fit.columns)


def _columns(model: Model, blocks: dict[Key, RowFactor]) -> tuple[int, ...]:
    """Return the base parameters whose columns are not zero in every sample used."""
    alive = np.zeros(len(model.base_parameters), dtype=bool)
    for block in blocks.values():
        alive[list(block.columns)] |= np.any(block.R[:, 1:-1] != 0.0, axis=0)
    return tuple(np.flatnonzero(alive).tolist())


def _solve(
    blocks: dict[Key, RowFactor],
    triangles: dict[Key, FloatArray],
    weights: dict[Key, float],
    columns: tuple[int, ...],
    width: int,
    banded: bool,
) -> _Solution:
    place = np.full(width, -1)
    place[list(columns)] = np.arange(len(columns))
    weighted, touched = [], []
    for key, block in blocks.items():
        own = place[list(block.columns)]
        weighted.append(weights[key] * triangles[key][:, np.append(own >= 0, True)])
        touched.append(own[own >= 0].tolist())
    x = np.zeros(width)
    if banded:
        chain = solve_banded(weighted, touched, len(columns))
        if chain.full_rank:
            x[list(columns)] = chain.x
            sure = np.zeros(len(columns), dtype=bool)
            return _Solution(x, None, chain.variance, sure, np.nan, np.nan)
    dense = np.zeros((sum(len(triangle) for triangle in weighted), len(columns) + 1))
    first = 0
    for triangle, own_columns in zip(weighted, touched, strict=True):
        dense[first : first + len(triangle), [*own_columns, len(columns)]] = triangle
        first += len(triangle)
    found = least_squares(dense[:, :-1], dense[:, -1])
    x[list(columns)] = found.x
    conditions = found.condition_number, found.condition_number_raw
    return _Solution(x, found.inverse, np.diag(found.inverse), found.undetermined, *conditions)


def _force_scales(
    model: Model, records: Sequence[RecordFactors], blocks: dict[Key, RowFactor]
) -> dict[Key, float]:
    """Return for every row the rms over all records of the forces, differentiated as often."""
    scale_of: dict[int, float] = {}
    for row in dict.fromkeys(row for _, row in blocks):
        alike = [records[record] for record, other in blocks if other == row]
        samples = sum(record.grid for record in alike)
        power = sum(record.grid * record.force_scale(model.rows[row]) ** 2 for record in alike)
        scale_of[row] = float(np.sqrt(power / samples)) or 1.0
    return {key: scale_of[key[1]] for key in blocks}
