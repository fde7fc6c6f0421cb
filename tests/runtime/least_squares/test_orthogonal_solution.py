"""What least squares does with columns that determine nothing."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.least_squares.orthogonal_solution import inverse_of, least_squares, polished
from modelgen.runtime.numerics.qr_triangle import triangle_of


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


def test_columns_that_differ_by_what_masks_leave_are_equal() -> None:
    """Two bodies that reverse together: their directions differ in the tails of the filter only."""
    rng = np.random.default_rng(5)
    signs, speed = np.sign(rng.normal(size=4000)), rng.normal(size=4000)
    W = np.column_stack([speed, 2.0 * signs, -(signs + 3e-7 * rng.normal(size=4000))])
    Y = W @ [1.0, 0.4, -0.2] + 1e-3 * rng.normal(size=4000)
    solution = polished(triangle_of(np.column_stack([W, Y])), [(W, Y)], alike=1e-5)
    assert solution.undetermined.tolist() == [False, True, True]
    assert 2.0 * solution.x[1] - solution.x[2] == pytest.approx(1.0, rel=1e-3)
    assert np.max(np.abs(solution.x)) < 2.0
    assert np.max(np.abs(least_squares(W, Y).x)) > 10.0
