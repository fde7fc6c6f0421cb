"""The triangle of a QR factorisation, without its Q."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.qr_update import compiled_take_in

# Numbers that are worked on at a time.
TALL = 1 << 18

# From so many columns on it is worth a look which of them are zero.
MANY = 24

# Matrices of many columns are taken together in so many neighbours first.
NEIGHBOURS = 16

# Rows to one factorisation: with eight columns they stay in the innermost cache.
ROWS_AT_A_TIME = 1024
# From so many rows on, compiled code saves more than the half second that loading it takes.
COMPILED_ROWS = 50_000


def tall_triangle(W: FloatArray | Sequence[FloatArray], Y: FloatArray) -> FloatArray:
    """Return R of [1 W Y], shape (c + 2, c + 2), of arrays of shape (n, c) and (n,); W may be several.

    Columns of zeros, of rows that touch few columns of many, cost nothing but their lines of zeros.
    """
    sides = [W] if isinstance(W, np.ndarray) else W
    ends = np.cumsum([1, *(side.shape[1] for side in sides)]).tolist()
    columns = ends[-1] - 1
    if columns >= MANY:
        W = np.hstack(sides)
        used = np.flatnonzero(np.any(W, axis=0))
        if 2 * len(used) < columns:
            R = np.zeros((columns + 2, columns + 2))
            place = np.concatenate([[0], used + 1, [columns + 1]])
            R[np.ix_(place, place)] = tall_triangle(np.ascontiguousarray(W[:, used]), Y)
            return R
    take_in = compiled_take_in() if len(Y) >= COMPILED_ROWS else None
    R = np.zeros((columns + 2, columns + 2))
    step = max(ROWS_AT_A_TIME, TALL // len(R) // ROWS_AT_A_TIME * ROWS_AT_A_TIME)
    for first in range(0, len(Y), step):
        part = slice(first, min(first + step, len(Y)))
        lines = np.empty((len(R), part.stop - first))
        lines[0], lines[-1] = 1.0, Y[part]
        for side, start, stop in zip(sides, ends[:-1], ends[1:], strict=True):
            lines[start:stop] = side[part].T
        if take_in is not None:
            take_in(R, lines)
            continue
        whole = lines.shape[1] // ROWS_AT_A_TIME * ROWS_AT_A_TIME
        cut = lines[:, :whole].reshape(len(R), -1, ROWS_AT_A_TIME)
        small = triangle_of(cut.transpose(1, 2, 0)).reshape(-1, len(R))
        R = triangle_of(np.vstack([R, small, lines[:, whole:].T]))
    return R


def joined_triangle(parts: Sequence[FloatArray]) -> FloatArray:
    """Return R of matrices below each other, shape (c, c); they have the shape (n, c) each.

    Where neighbours touch few of many columns, as the rows of a chain do, these few are worked on first.
    """
    if len(parts) > NEIGHBOURS and parts[0].shape[1] >= MANY:
        groups = [parts[first : first + NEIGHBOURS] for first in range(0, len(parts), NEIGHBOURS)]
        parts = [_few_lines(np.concatenate(group)) for group in groups]
    return triangle_of(np.concatenate(parts))


def _few_lines(matrix: FloatArray) -> FloatArray:
    """Return a matrix with the same sums of products, shape (k, c), of no more lines than used columns."""
    used = np.flatnonzero(np.any(matrix, axis=0))
    if len(used) >= len(matrix):
        return matrix
    lines = np.zeros((len(used), matrix.shape[1]))
    lines[:, used] = triangle_of(matrix[:, used])
    return lines


def lines_of(triangle: FloatArray) -> FloatArray:
    """Return the lines of a triangle, shape (k, c), that are not zero: as good in a sum of squares."""
    return np.asarray(triangle[np.any(triangle, axis=1)])


def triangle_of(matrix: FloatArray) -> FloatArray:
    """Return R of matrix = Q R, shape (..., c, c), with lines of zeros where the matrix has fewer than c."""
    R = np.asarray(np.linalg.qr(matrix, mode="r"), dtype=float)
    missing = R.shape[-1] - R.shape[-2]
    if missing <= 0:
        return R
    return np.concatenate([R, np.zeros((*R.shape[:-2], missing, R.shape[-1]))], axis=-2)
