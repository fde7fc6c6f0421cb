"""What least squares does with columns that determine nothing."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.least_squares.orthogonal_solution import inverse_of, least_squares


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("zeros", [1, 2])
def test_a_column_of_zeros_is_undetermined_and_disturbs_nothing(zeros: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(40, 5)) * 10.0 ** rng.uniform(-6.0, 6.0, 5)
    Y = rng.normal(size=40)
    empty = rng.permutation(5)[:zeros]
    others = np.setdiff1d(np.arange(5), empty)
    W[:, empty] = 0.0
    found, alone = least_squares(W, Y), least_squares(W[:, others], Y)
    assert np.flatnonzero(found.undetermined).tolist() == sorted(empty.tolist())
    assert np.allclose(found.x[others], alone.x, rtol=1e-9)
    assert np.allclose(found.x[empty], 0.0, atol=1e-9)
    assert np.allclose(found.inverse[np.ix_(others, others)], alone.inverse, rtol=1e-9)


def test_a_large_triangle_is_inverted_by_halves() -> None:
    rng = np.random.default_rng(6)
    triangle = np.triu(rng.normal(size=(131, 131))) + 12.0 * np.eye(131)
    found = inverse_of(triangle, 1e-10)
    assert found.inverse @ triangle == pytest.approx(np.eye(131), abs=1e-12)
    assert not found.inverse[np.tril_indices(131, -1)].any()
