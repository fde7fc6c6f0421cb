"""A triangle takes in more rows: Householder's reflections, written for a compiler.

The rows stand below a triangle, so that the reflection of column j changes line j of the triangle and the
rows, nothing else. The triangle is that of the QR factorisation up to the signs of its lines.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from modelgen.runtime.numerics.numba_support import compiled

# Rows at a time: with eight columns they stay in the innermost cache.
ROWS = 512


def take_in(R: Any, lines: Any) -> None:
    """Replace R by the triangle of R above more rows.

    Parameters
    ----------
    R : array, shape (c, c)
        Upper triangular; changed in place.
    lines : array, shape (c, n)
        The rows, a column of theirs a line.
    """
    c, n = lines.shape
    rows = np.empty((c, min(n, ROWS)))
    for first in range(0, n, ROWS):
        m = min(ROWS, n - first)
        for j in range(c):
            column, source = rows[j], lines[j, first : first + m]
            for i in range(m):
                column[i] = source[i]
        for j in range(c):
            reflect(R, rows, m, j)


def reflect(R: Any, rows: Any, m: int, j: int) -> None:
    """Make column j of m rows zero by a reflection with line j of the triangle; the rows are changed."""
    vector = rows[j, :m]
    square = 0.0
    for i in range(m):
        square += vector[i] * vector[i]
    if square == 0.0:
        return
    head = R[j, j]
    norm = np.sqrt(head * head + square)
    new = -norm if head > 0.0 else norm  # away from the head, so that nothing cancels
    top = head - new
    scale = 1.0 / (norm * (norm + abs(head)))
    R[j, j] = new
    for k in range(j + 1, len(rows)):
        column = rows[k, :m]
        inner = top * R[j, k]
        for i in range(m):
            inner += vector[i] * column[i]
        inner *= scale
        R[j, k] -= inner * top
        for i in range(m):
            column[i] -= inner * vector[i]


def compiled_take_in() -> Callable[[Any, Any], None] | None:
    """Return `take_in`, compiled, or None without numba."""
    loops: Callable[[Any, Any], None] | None = compiled(take_in, (reflect,))
    return loops
