"""Further columns projected out leave the solution and the spread that fitting with them gives."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.least_squares.further_columns import with_columns, with_columns_free, without_columns
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock


@pytest.mark.parametrize("seed", range(10))
def test_the_fit_without_has_the_solution_of_the_fit_with(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, further, blocks, extra = int(rng.integers(1, 5)), int(rng.integers(1, 4)), [], []
    for row in range(int(rng.integers(1, 4))):
        n = int(rng.integers(60, 200))
        W = rng.standard_normal((n, c)) * 10.0 ** rng.uniform(-4.0, 4.0, c)
        more = rng.standard_normal((n, further)) * 10.0 ** rng.uniform(-8.0, 8.0, further)
        Y = W @ np.ones(c) + more @ np.full(further, 1e-6) + 0.1 * rng.standard_normal(n)
        blocks.append(RowBlock(0, row, "run", f"row {row}", "N", np.arange(n), n, Y, W, 0, True, 1.0, 0))
        extra.append(more)
    fit = fit_matched(Observation(tuple(f"x{k}" for k in range(c)), tuple(blocks)))
    added = [[part[:, k] for part in extra] for k in range(further)]
    larger = with_columns(fit, fit.regressors, added)
    stacked = np.concatenate(
        [w * np.column_stack([b.W, more]) for w, b, more in zip(fit.weights, blocks, extra, strict=True)]
    )
    scale = np.linalg.norm(stacked, axis=0)
    measured = np.concatenate([w * b.Y for w, b in zip(fit.weights, blocks, strict=True)])
    expected = np.linalg.lstsq(stacked / scale, measured, rcond=None)[0] / scale
    np.testing.assert_allclose(larger.solution.x, expected, rtol=1e-7, atol=1e-12 / scale.min())
    without = without_columns(larger, fit)
    assert without.columns == fit.columns
    np.testing.assert_allclose(without.solution.x, larger.solution.x[:c], rtol=1e-7)
    np.testing.assert_allclose(without.solution.inverse, larger.solution.inverse[:c, :c], rtol=1e-6, atol=0.0)
    free = with_columns_free(fit, added)
    np.testing.assert_allclose(free.solution.x, without.solution.x, rtol=1e-7)
    np.testing.assert_allclose(free.solution.inverse, without.solution.inverse, rtol=1e-6, atol=0.0)
    np.testing.assert_allclose(
        free.regressors[0].dense(), without.regressors[0].dense(), rtol=1e-6, atol=1e-9
    )
