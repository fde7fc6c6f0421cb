"""The fit of `wls`, asked of triangles instead of rows: whatever the length of the records.

Whatever a round of re-weighting needs is in the triangles; only the last one, of all rows together, is new in
each round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.contract import Model
from modelgen.runtime.frontal import solve_banded
from modelgen.runtime.observation import LEAST_FORCE
from modelgen.runtime.record_factors import RecordFactors
from modelgen.runtime.row_factor import RowFactor
from modelgen.runtime.wls import LOAD_ROW_SHARE, ROUNDS, SMALLEST_RESIDUAL, least_squares

FloatArray = npt.NDArray[np.float64]

# From so many columns the banded solution is used; below, all singular values are looked at.
BANDED_COLUMNS = 40


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
    condition_number : float
        Of W with columns of unit length; nan for the banded solution.
    weights : dict of (record, row) to float
    rms : dict of (record, row) to float
        Of the unweighted residual.
    samples : int
        Rows of W.
    residual_norm, measured_norm : float
        Norms of Y - W X and Y, both weighted.
    """

    columns: tuple[int, ...]
    x: FloatArray
    inverse: FloatArray | None
    variance: FloatArray
    undetermined: npt.NDArray[np.bool_]
    condition_number: float
    weights: dict[tuple[int, int], float]
    rms: dict[tuple[int, int], float]
    samples: int
    residual_norm: float
    measured_norm: float

    @property
    def sigma(self) -> float:
        """Standard deviation of the weighted residual, eq. (11)."""
        return self.residual_norm / float(np.sqrt(self.samples - len(self.columns)))


@dataclass(frozen=True, eq=False)
class _Solution:
    x: FloatArray
    inverse: FloatArray | None
    variance: FloatArray
    undetermined: npt.NDArray[np.bool_]
    condition_number: float


def fit_factors(model: Model, records: Sequence[RecordFactors], banded: bool | None = None) -> FactorFit:
    """Fit as `wls.fit_matched` does: force-scaled start, weights from the residuals, load rows bounded.

    Parameters
    ----------
    model : Model
    records : sequence of RecordFactors
    banded : bool, optional
        Whether to use the banded solution; by default where there are many columns.

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

    def own_scale(key: tuple[int, int]) -> float:
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

    def solve(weights: dict[tuple[int, int], float]) -> _Solution:
        return _solve(blocks, triangles, weights, columns, len(model.base_parameters), use_band)

    def rms(solution: _Solution) -> dict[tuple[int, int], float]:
        return {key: block.residual_rms(solution.x) for key, block in blocks.items()}

    weights = {key: 1.0 / scales[key] for key in blocks} if len(blocks) > 1 else dict.fromkeys(blocks, 1.0)
    solution = solve(weights)
    if len(blocks) > 1:
        first = rms(solution)
        least = {
            key: max(0.0 if forced[key] else first[key] / LOAD_ROW_SHARE, SMALLEST_RESIDUAL * scales[key])
            for key in blocks
        }
        for _ in range(ROUNDS):
            weights = {key: 1.0 / max(value, least[key]) for key, value in rms(solution).items()}
            solution = solve(weights)
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
        weights,
        found,
        samples,
        float(np.sqrt(squares)),
        float(np.sqrt(measured)),
    )


def _columns(model: Model, blocks: dict[tuple[int, int], RowFactor]) -> tuple[int, ...]:
    """Return the base parameters whose columns are not zero in every sample used."""
    alive = np.zeros(len(model.base_parameters), dtype=bool)
    for block in blocks.values():
        alive[list(block.columns)] |= np.any(block.R[:, 1:-1] != 0.0, axis=0)
    return tuple(np.flatnonzero(alive).tolist())


def _solve(
    blocks: dict[tuple[int, int], RowFactor],
    triangles: dict[tuple[int, int], FloatArray],
    weights: dict[tuple[int, int], float],
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
            return _Solution(x, None, chain.variance, sure, np.nan)
    dense = np.zeros((sum(len(triangle) for triangle in weighted), len(columns) + 1))
    first = 0
    for triangle, own_columns in zip(weighted, touched, strict=True):
        dense[first : first + len(triangle), [*own_columns, len(columns)]] = triangle
        first += len(triangle)
    found = least_squares(dense[:, :-1], dense[:, -1])
    x[list(columns)] = found.x
    return _Solution(x, found.inverse, np.diag(found.inverse), found.undetermined, found.condition_number)


def _force_scales(
    model: Model, records: Sequence[RecordFactors], blocks: dict[tuple[int, int], RowFactor]
) -> dict[tuple[int, int], float]:
    """Return for every row the rms over all records of the forces, differentiated as often."""
    scale_of: dict[int, float] = {}
    for row in dict.fromkeys(row for _, row in blocks):
        alike = [records[record] for record, other in blocks if other == row]
        samples = sum(record.grid for record in alike)
        power = sum(record.grid * record.force_scale(model.rows[row]) ** 2 for record in alike)
        scale_of[row] = float(np.sqrt(power / samples)) or 1.0
    return {key: scale_of[key[1]] for key in blocks}
