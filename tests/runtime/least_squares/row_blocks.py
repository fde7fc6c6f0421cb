"""Blocks of rows as the tests of least squares write them down."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modelgen.runtime.rows.row_block import RowBlock

FloatArray = npt.NDArray[np.float64]


def block(
    W: FloatArray,
    Y: FloatArray,
    row: int = 0,
    record: int = 0,
    scale: float = 1.0,
    has_force: bool = True,
    grid: int | None = None,
) -> RowBlock:
    """A block with every sample of its grid in use, unless `grid` says that there are more."""
    return RowBlock(
        record=record,
        row=row,
        record_name=f"record {record}",
        row_name=f"row {row}",
        unit="N",
        place=np.arange(len(Y)),
        grid=len(Y) if grid is None else grid,
        Y=Y,
        W=W,
        masked=0,
        has_force=has_force,
        force_scale=scale,
        differentiated=0,
    )
