"""RowFactor: all that least squares needs of one row of a model on one record, in a small triangle.

[1 W Y] = Q R: whatever a fit asks of the rows (solution, residual, spread of a term about its mean) it can
ask of R. Triangles of two stretches are joined by the QR of both, in any order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.runtime.numerics.qr_triangle import triangle_of
from modelgen.runtime.numerics.qr_update import compiled_take_in

FloatArray = npt.NDArray[np.float64]

# Rows to one QR: with eight columns they stay in the innermost cache.
ROWS_AT_A_TIME = 1024


@dataclass(frozen=True, eq=False)
class RowFactor:
    """R of [1 W Y] for one row of the model, W reduced to the columns that the row touches.

    Attributes
    ----------
    row : int
        Index of the model's row.
    columns : tuple of int
        Base parameters the row touches.
    R : array, shape (k + 2, k + 2)
        Upper triangular; columns 1, W, Y.
    samples, masked : int
        Samples used, and left out.
    """

    row: int
    columns: tuple[int, ...]
    R: FloatArray
    samples: int = 0
    masked: int = 0

    @property
    def triangle(self) -> FloatArray:
        """R of [W Y], shape (k + 1, k + 1)."""
        return triangle_of(self.R[:, 1:])

    def with_rows(self, transposed: FloatArray, fast: bool | None = None) -> RowFactor:
        """Return the factor with more samples, given as rows 1, W, Y of an array of shape (k + 2, n).

        `fast` says whether to use compiled code; by default wherever numba is installed.
        """
        samples = self.samples + transposed.shape[1]
        take_in = None if fast is False else compiled_take_in()
        if take_in is not None:
            R = self.R.copy()
            take_in(R, np.ascontiguousarray(transposed))
            return replace(self, R=R, samples=samples)
        count = transposed.shape[1] // ROWS_AT_A_TIME
        whole = transposed[:, : count * ROWS_AT_A_TIME].reshape(len(transposed), count, ROWS_AT_A_TIME)
        small = triangle_of(whole.transpose(1, 2, 0)).reshape(-1, len(transposed))
        rest = transposed[:, count * ROWS_AT_A_TIME :].T
        R = triangle_of(np.vstack([self.R, small, rest]))
        return replace(self, R=R, samples=samples)

    def joined(self, other: RowFactor, fast: bool | None = None) -> RowFactor:
        """Return the factor of both stretches; `fast` as for `with_rows`."""
        take_in = None if fast is False else compiled_take_in()
        if take_in is not None:
            R = self.R.copy()
            take_in(R, np.ascontiguousarray(other.R.T))
        else:
            R = triangle_of(np.vstack([self.R, other.R]))
        samples, masked = self.samples + other.samples, self.masked + other.masked
        return replace(self, R=R, samples=samples, masked=masked)

    def residual_rms(self, x: FloatArray) -> float:
        """Return the rms of Y - W x; x holds the values of all base parameters."""
        short = self.R[:, -1] - self.R[:, 1:-1] @ x[list(self.columns)]
        return float(np.linalg.norm(short) / np.sqrt(max(self.samples, 1)))

    def terms_norm(self, x: FloatArray) -> float:
        """Return how much the largest term W_j x_j varies about its mean (its norm)."""
        spread = np.linalg.norm(self.R[1:, 1:-1], axis=0) * np.abs(x[list(self.columns)])
        return float(np.max(spread, initial=0.0))

    @property
    def force_norm(self) -> float:
        """Norm of Y."""
        return float(np.linalg.norm(self.R[:, -1]))


def empty_factor(row: int, columns: Sequence[int]) -> RowFactor:
    """Return the factor of no samples."""
    size = len(columns) + 2
    return RowFactor(row, tuple(columns), np.zeros((size, size)))
