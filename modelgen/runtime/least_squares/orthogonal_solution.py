"""Y = W X by orthogonal factorisation: the solution, its inverse, and which columns cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.least_squares.thresholds import (
    FEW_ROWS,
    NULL_SHARE,
    RANK_TOLERANCE,
    REFINABLE,
    ROUNDING,
)
from modelgen.runtime.numerics.iterative_refinement import refined
from modelgen.runtime.numerics.regressor import Regressor, regressor


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """X = argmin |Y - W X|: x, inverse = (W^T W)^-1; `undetermined` marks columns the rows cannot separate.

    `condition_number` is that of W with columns of unit length, `condition_number_raw` that of W itself.
    `null` are the directions, shape (k, c), that W does not see with columns of unit length, and `scale` the
    lengths of its columns, shape (c,).
    """

    x: FloatArray
    inverse: FloatArray
    undetermined: BoolArray
    condition_number: float
    condition_number_raw: float
    null: FloatArray
    scale: FloatArray

    def unseen(self, sums: FloatArray) -> BoolArray:
        """Tell which weighted sums of X, shape (m, c), move along what the rows do not see, shape (m,)."""
        scaled = sums / self.scale
        size = np.linalg.norm(scaled, axis=1)
        along = np.abs(scaled @ self.null.T)
        return np.asarray(np.any(along > NULL_SHARE * size[:, None], axis=1))


def least_squares(W: FloatArray, Y: FloatArray) -> LeastSquares:
    """Solve Y = W X on columns of unit length by QR, and the small triangle by its singular values.

    Parameters
    ----------
    W : array, shape (r, c)
        More rows than columns.
    Y : array, shape (r,)

    Notes
    -----
    The normal equations would lose half of the digits. Where W is short of rank, the shortest solution (of
    the scaled columns) is taken and the columns that take part in the ambiguity are marked.
    """
    return polished(np.asarray(np.linalg.qr(np.column_stack([W, Y]), mode="r")), [(W, Y)])


def polished(
    triangle: FloatArray,
    parts: Sequence[tuple[FloatArray | Regressor, FloatArray]],
    tolerance: float = RANK_TOLERANCE,
) -> LeastSquares:
    """Return the solution of R = `triangle` of [W Y], freed of what rounding has moved.

    `parts` are W and Y themselves, cut into pieces of n rows, (n, c) and (n,); none where rounding is no
    matter. Singular values below the share `tolerance` of the largest count as zero.
    """
    c = triangle.shape[1] - 1
    scale = np.linalg.norm(triangle[:, :c], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)  # what is zero everywhere is undetermined
    scaled = triangle[:c, :c] / scale
    U, s, Vt = np.linalg.svd(scaled)
    kept = s > tolerance * s[0]
    V = Vt[kept].T
    x = V @ (U[:, kept].T @ triangle[:c, c] / s[kept]) / scale
    inverse = (V / s[kept] ** 2) @ V.T / np.outer(scale, scale)
    null = Vt[~kept]
    undetermined = np.any(np.abs(null) > NULL_SHARE, axis=0)
    condition = float(s[0] / s[-1]) if s[-1] > 0.0 else np.inf
    if not parts:
        return LeastSquares(x, inverse, undetermined, condition, np.nan, null, scale)
    if s[-1] * REFINABLE > s[0]:
        # corrected seminormal equations (Björck, Linear Algebra Appl. 88, 1987, 31-48): undoes what rounding
        # in QR, and with it the order of the rows, has moved
        gradient, count = np.zeros(c), 0
        for W, Y in parts:  # each pass may make them anew
            of = regressor(W)
            gradient += of.across(Y - of.times(x))
            count += len(Y)
        x = x + inverse @ gradient
        rounding = _rounding(s, float(np.linalg.norm(x * scale)), float(np.abs(triangle[c:, c]).sum()))
        if count <= FEW_ROWS or rounding > ROUNDING:
            x = refined(parts, x, inverse)
    raw = float(np.linalg.cond(triangle[:c, :c]))
    return LeastSquares(x, inverse, undetermined, condition, raw, null, scale)


def _rounding(s: FloatArray, size: float, residual: float) -> float:
    """Return what share of the solution rounding may cost (Wedin 1973, eq. (5.4))."""
    condition, unit = float(s[0] / s[-1]), float(np.finfo(float).eps)
    floor = float(np.finfo(float).tiny)
    return unit * condition * (1.0 + condition * residual / max(float(s[0]) * size, floor))
