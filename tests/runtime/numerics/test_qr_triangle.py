"""Triangles: as good in every sum of squares as the rows that they come from."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.qr_triangle import (
    MANY,
    NEIGHBOURS,
    joined_triangle,
    lines_of,
    tall_triangle,
    triangle_of,
)


@pytest.mark.parametrize("used", [(), (0,), (3, 17, MANY + 1), tuple(range(MANY + 2))])
@pytest.mark.parametrize("n", [3, 500])
def test_columns_of_zeros_change_no_sum_of_squares(n: int, used: tuple[int, ...]) -> None:
    rng = np.random.default_rng(n)
    W, Y = np.zeros((n, MANY + 2)), rng.standard_normal(n)
    W[:, used] = rng.standard_normal((n, len(used)))
    R, rows = tall_triangle(W, Y), np.column_stack([np.ones(n), W, Y])
    np.testing.assert_allclose(R.T @ R, rows.T @ rows, atol=1e-12 * n)
    np.testing.assert_array_equal(R, np.triu(R))
    kept = lines_of(R[:, 1:])
    np.testing.assert_allclose(kept.T @ kept, rows[:, 1:].T @ rows[:, 1:], atol=1e-12 * n)
    assert len(kept) <= len(used) + 2


@pytest.mark.parametrize("touched", [3, MANY])
@pytest.mark.parametrize("count", [2, 3 * NEIGHBOURS + 1])
def test_parts_that_touch_few_columns_are_joined_to_the_triangle_of_all(count: int, touched: int) -> None:
    rng, columns = np.random.default_rng(count), MANY + count
    parts = []
    for first in range(count):
        part = np.zeros((touched + 2, columns))
        part[:, first : first + touched] = 10.0 ** (first % 5) * rng.standard_normal((touched + 2, touched))
        parts.append(part)
    R, whole = joined_triangle(parts), triangle_of(np.concatenate(parts))
    np.testing.assert_array_equal(R, np.triu(R))
    scale = np.maximum(np.linalg.norm(whole, axis=0), 1.0)
    np.testing.assert_allclose((R / scale).T @ (R / scale), (whole / scale).T @ (whole / scale), atol=1e-13)
