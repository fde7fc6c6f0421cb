from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from modelgen.runtime.numerics.matrix_exponential import matrix_exponential


@pytest.mark.parametrize("seed", range(40))
def test_it_is_that_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    A = 10.0 ** rng.uniform(-6.0, 1.0) * rng.standard_normal((n, n))
    expected = expm(A)
    np.testing.assert_allclose(matrix_exponential(A), expected, atol=1e-11 * np.abs(expected).max())


def test_a_nilpotent_matrix_gives_a_polynomial() -> None:
    A = np.diag([1e3, 1e3], 1)
    np.testing.assert_allclose(matrix_exponential(A), np.eye(3) + A + A @ A / 2.0, rtol=1e-13)


def test_nothing_and_zero() -> None:
    assert matrix_exponential(np.zeros((0, 0))).shape == (0, 0)
    np.testing.assert_array_equal(matrix_exponential(np.zeros((4, 4))), np.eye(4))
