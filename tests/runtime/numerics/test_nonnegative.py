from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from modelgen.runtime.numerics.nonnegative import nonnegative


@pytest.mark.parametrize("seed", range(60))
def test_it_finds_what_scipy_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = int(rng.integers(1, 9))
    A = rng.standard_normal((60, columns)) ** (2 if seed % 2 else 1)
    b = A @ rng.standard_normal(columns) + rng.standard_normal(60)
    expected, _ = nnls(A, b)
    np.testing.assert_allclose(nonnegative(A, b), expected, atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_equal_columns_share_what_one_would_have(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = np.abs(rng.standard_normal((50, 3)))
    A = np.column_stack([A, A[:, 0], np.zeros(50)])
    b = A[:, :3] @ np.array([1.0, 0.0, 2.0]) + 0.1 * rng.standard_normal(50)
    found, expected = nonnegative(A, b), nnls(A[:, :3], b)[0]
    assert found.min() >= 0.0
    np.testing.assert_allclose(A @ found, A[:, :3] @ expected, atol=1e-10)
