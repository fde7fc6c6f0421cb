"""Y = W X by orthogonal factorisation: the solution, its inverse, and which columns cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.least_squares.thresholds import (
    FEW_ROWS,
    HALVED,
    NULL_SHARE,
    POWERS,
    RANK_TOLERANCE,
    REFINABLE,
    ROUNDING,
)
from modelgen.runtime.numerics.iterative_refinement import refined
from modelgen.runtime.numerics.qr_triangle import triangle_of
from modelgen.runtime.numerics.regressor import Regressor, regressor


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """X = argmin |Y - W X|: x, inverse = (W^T W)^-1; `undetermined` marks columns the rows cannot separate.

    `null` are the directions, shape (k, c), that W does not see with columns of unit length, and `scale` the
    lengths of its columns, shape (c,). `triangle` is R of the rows that were solved, shape (c, c).
    """

    x: FloatArray
    inverse: FloatArray
    undetermined: BoolArray
    null: FloatArray
    scale: FloatArray
    triangle: FloatArray

    @cached_property
    def condition_number(self) -> float:
        """Condition number of W with columns of unit length."""
        s = np.linalg.svd(self.triangle / _lengths(self.triangle), compute_uv=False)
        return float(s[0] / s[-1]) if s[-1] > 0.0 else np.inf

    @cached_property
    def condition_number_raw(self) -> float:
        """Condition number of W as it is."""
        return float(np.linalg.cond(self.triangle))

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
    return polished(triangle_of(np.column_stack([W, Y])), [(W, Y)])


def polished(
    triangle: FloatArray,
    parts: Sequence[tuple[FloatArray | Regressor, FloatArray]],
    tolerance: float = RANK_TOLERANCE,
    alike: float = 0.0,
) -> LeastSquares:
    """Return the solution of R = `triangle` of [W Y], freed of what rounding has moved.

    `parts` are W and Y themselves, cut into pieces of n rows, (n, c) and (n,); none where rounding is no
    matter. Singular values below the share `tolerance` of the largest count as zero, and columns of W that
    differ by no more than the share `alike` of their length, but for a factor, as equal.
    """
    c = triangle.shape[1] - 1
    triangle = _with_equal_columns(triangle, alike)
    x, inner, scale = _solved(triangle, tolerance)
    inverse = inner.inverse @ inner.inverse.T / np.outer(scale, scale)
    null = inner.null
    undetermined = np.any(np.abs(null) > NULL_SHARE, axis=0)
    if parts and inner.largest < inner.smallest * REFINABLE:
        # corrected seminormal equations (Björck, Linear Algebra Appl. 88, 1987, 31-48): undoes what rounding
        # in QR, and with it the order of the rows, has moved
        gradient, count = np.zeros(c), 0
        for W, Y in parts:  # each pass may make them anew
            of = regressor(W)
            gradient += of.across(Y - of.times(x))
            count += len(Y)
        x = x + inverse @ gradient
        size, residual = float(np.linalg.norm(x * scale)), float(np.abs(triangle[c:, c]).sum())
        rounding = _rounding(inner, size, residual)
        if count <= FEW_ROWS or rounding > ROUNDING:
            x = refined(parts, x, inverse)
    return LeastSquares(x, inverse, undetermined, null, scale, triangle[:c, :c])


def rough_solution(triangle: FloatArray) -> FloatArray:
    """Return X alone of R = `triangle` of [W Y], in units of Y per W, (c,), with what rounding has moved."""
    return _solved(triangle, RANK_TOLERANCE)[0]


def _solved(triangle: FloatArray, tolerance: float) -> tuple[FloatArray, TriangleInverse, FloatArray]:
    """Return X, the inverse of the triangle with columns of unit length, and the lengths that they had."""
    c = triangle.shape[1] - 1
    scale = _lengths(triangle[:c, :c])
    inner = inverse_of(triangle[:c, :c] / scale, tolerance)
    return inner.inverse @ triangle[:c, c] / scale, inner, scale


def _with_equal_columns(triangle: FloatArray, alike: float) -> FloatArray:
    """Return the triangle of [W Y], (m, c + 1), with one direction for columns that nearly have the same."""
    c = triangle.shape[1] - 1
    lengths = _lengths(triangle[:, :c])
    units = triangle[:, :c] / lengths
    cosines = units.T @ units
    same = np.triu(1.0 - np.abs(cosines) < 0.5 * alike**2, 1)
    if not same.any():
        return triangle
    found = triangle.copy()
    for first, second in np.argwhere(same).tolist():
        ratio = np.sign(cosines[first, second]) * lengths[second] / lengths[first]
        found[:, second] = ratio * found[:, first]
    return found


def _lengths(triangle: FloatArray) -> FloatArray:
    """Return the lengths of columns, 1 where they are zero: what is zero everywhere is undetermined."""
    lengths = np.linalg.norm(triangle, axis=0)
    return np.where(lengths > 0.0, lengths, 1.0)


@dataclass(frozen=True, eq=False)
class TriangleInverse:
    """The inverse of a triangle, shape (c, c), or where it is short of rank its pseudo-inverse.

    `null` are the directions that count as not seen, shape (k, c), and `largest` and `smallest` the extreme
    singular values.
    """

    inverse: FloatArray
    null: FloatArray
    largest: float
    smallest: float


def inverse_of(triangle: FloatArray, tolerance: float) -> TriangleInverse:
    """Return the inverse of an upper triangle, shape (c, c), with columns of unit length.

    Singular values below the share `tolerance` of the largest count as zero. They are worked out where they
    may be small; elsewhere two of them, to a few per cent, from powers of the triangle and of its inverse.
    """
    if np.min(np.abs(np.diag(triangle)), initial=1.0) * REFINABLE > 1.0:
        inverse = _inverse(triangle)
        # by their norms nothing is near a limit
        bound = float(np.linalg.norm(triangle) * np.linalg.norm(inverse))
        if bound < REFINABLE and bound * tolerance < 1.0:
            nothing = np.empty((0, len(triangle)))
            return TriangleInverse(inverse, nothing, _stretch(triangle), 1.0 / _stretch(inverse))
    U, s, Vt = np.linalg.svd(triangle)
    kept = s > tolerance * s[0]
    inverse = (Vt[kept].T / s[kept]) @ U[:, kept].T
    return TriangleInverse(inverse, Vt[~kept], float(s[0]), float(s[-1]))


def _inverse(triangle: FloatArray) -> FloatArray:
    """Return the inverse of an upper triangle; of a large one from those of its halves."""
    half = len(triangle) // 2
    if half < HALVED:
        return np.asarray(np.linalg.inv(triangle), dtype=float)
    result = np.zeros_like(triangle)
    result[:half, :half], result[half:, half:] = (
        _inverse(triangle[:half, :half]),
        _inverse(triangle[half:, half:]),
    )
    result[:half, half:] = -result[:half, :half] @ triangle[:half, half:] @ result[half:, half:]
    return result


def _stretch(matrix: FloatArray) -> float:
    """Return the largest singular value of a square matrix, a few per cent too small at most."""
    along = np.sum(np.abs(matrix), axis=0)
    for _ in range(POWERS):
        along = matrix.T @ (matrix @ (along / sqrt(along @ along)))
    return sqrt(sqrt(along @ along))


def _rounding(inner: TriangleInverse, size: float, residual: float) -> float:
    """Return what share of the solution rounding may cost (Wedin 1973, eq. (5.4))."""
    condition, unit = inner.largest / inner.smallest, float(np.finfo(float).eps)
    floor = float(np.finfo(float).tiny)
    return unit * condition * (1.0 + condition * residual / max(inner.largest * size, floor))
