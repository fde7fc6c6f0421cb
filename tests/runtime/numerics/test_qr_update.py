"""A triangle that takes in rows is the triangle of the QR factorisation of all rows, compiled or not."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.qr_update import ROWS, compiled_take_in, take_in


@pytest.mark.parametrize("way", ["interpreted", "compiled"])
def test_rows_are_taken_in(way: str) -> None:
    take = take_in if way == "interpreted" else compiled_take_in()
    if take is None:
        pytest.skip("numba is not installed (extra fast)")
    W = np.random.default_rng(4).standard_normal((ROWS + 70, 4)) * [1.0, 1e3, 1e-3, 1.0]
    W[:, 3] = W[:, 0] + 1e-6 * W[:, 3]
    R = np.zeros((4, 4))
    for first, last in ((0, 3), (3, ROWS + 20), (ROWS + 20, len(W))):
        take(R, np.ascontiguousarray(W[first:last].T))
    expected = np.linalg.qr(W, mode="r")
    np.testing.assert_allclose(np.abs(R), np.abs(expected), rtol=1e-9, atol=1e-15)


def test_rows_of_zeros_change_nothing() -> None:
    R = np.triu(np.arange(1.0, 10.0).reshape(3, 3))
    before = R.copy()
    take_in(R, np.zeros((3, 5)))
    np.testing.assert_array_equal(R, before)
