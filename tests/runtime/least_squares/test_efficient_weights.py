"""Instruments on white rows: nearer to the truth than with one weight a row, and honest about it."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.efficient_weights import efficient
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import with_columns, without_columns
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, influence
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from tests.runtime.least_squares.row_blocks import block

N = 1500
TRUTH = np.array([2.0, -1.0, 0.5])


def smooth(rng: np.random.Generator, columns: int) -> FloatArray:
    series = rng.standard_normal((N + 60, columns))
    return np.stack([np.convolve(one, np.hanning(30) / 4.0, "same")[30:-30] for one in series.T], axis=1)


def fitted(seed: int) -> tuple[Fit, list[FloatArray]]:
    """Two rows whose noise is one series, as it is and differentiated twice, and some of their own."""
    rng = np.random.default_rng(seed)
    Z = [smooth(rng, 3), smooth(rng, 3)]
    shared = rng.standard_normal(N + 2)
    noise = [
        np.diff(shared, n=2) + 0.05 * rng.standard_normal(N),
        shared[1:-1] + 0.05 * rng.standard_normal(N),
    ]
    rows = [block(z, z @ TRUTH + e, row=k) for k, (z, e) in enumerate(zip(Z, noise, strict=True))]
    first = fit_matched(Observation(("a", "b", "c"), tuple(rows)))
    return two_stage(first, tuple(Z)), Z


@pytest.mark.slow
def test_its_estimates_scatter_less_and_its_deviations_say_by_how_much() -> None:
    plain, white, stated = [], [], []
    for seed in range(60):
        fit, _ = fitted(seed)
        found = efficient(fit)
        plain.append(fit.solution.x - TRUTH)
        white.append(found.solution.x - TRUTH)
        stated.append(np.diag(hac_covariance(found)))
    spread = np.sqrt(np.mean(np.square(white), axis=0))
    assert np.all(spread < 0.3 * np.sqrt(np.mean(np.square(plain), axis=0)))
    assert np.all(np.abs(np.mean(white, axis=0)) < 0.5 * spread)
    scaled = np.array(white) / np.sqrt(stated)
    assert 0.8 < float(np.sqrt(np.mean(scaled**2))) < 1.2
    assert np.mean(np.abs(scaled) < 1.96) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_rows_stay_as_they_were_and_residuals_are_those_of_the_solution(seed: int) -> None:
    fit, _ = fitted(seed)
    found = efficient(fit)
    for before, after, residual in zip(fit.blocks, found.blocks, found.residuals, strict=True):
        np.testing.assert_array_equal(after.Y, before.Y)
        np.testing.assert_allclose(residual, before.Y - before.W @ found.solution.x)
    # the influences are those of the solution: they add up to nothing
    total = np.abs(np.sum(np.concatenate(influence(found)), axis=0))
    assert np.all(total < 1e-9 * np.sqrt(np.diag(hac_covariance(found))) * N)


@pytest.mark.parametrize("seed", range(3))
def test_what_rows_grow_by_moves_the_solution_as_white_rows_say(seed: int) -> None:
    fit, _ = fitted(seed)
    assert fit.white is None
    found = efficient(fit)
    assert found.white is not None
    for column in range(3):
        moved = found.white.moved([row.W[:, column] for row in fit.blocks])
        np.testing.assert_allclose(moved, np.eye(3)[column], atol=1e-8)
    # what noise of the rows does to the solution is what it moves
    noise = [row.Y - row.W @ TRUTH for row in fit.blocks]
    np.testing.assert_allclose(found.white.moved(noise), found.solution.x - TRUTH, atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_solving_again_with_plain_weights_forgets_it(seed: int) -> None:
    fit, Z = fitted(seed)
    again = two_stage(efficient(fit), tuple(Z))
    assert again.series is None
    np.testing.assert_allclose(again.solution.x, fit.solution.x, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_further_columns_stay_free_in_its_covariance(seed: int) -> None:
    fit, Z = fitted(seed)
    extra = [smooth(np.random.default_rng((9, seed)), 1) for _ in range(2)]
    larger = efficient(with_columns(fit, Z, [[part[:, 0] for part in extra]]))
    found = without_columns(larger, fit)
    np.testing.assert_array_equal(found.solution.x, larger.solution.x[:3])
    c, n = 3, larger.count
    alike = (n - c - found.lost) / (n - c - 1 - larger.lost)
    # directions of few instants are found in three columns, or in five
    whole = hac_covariance(larger)[:3, :3]
    deviations = np.sqrt(np.diag(whole))
    off = (alike * hac_covariance(found) - whole) / np.outer(deviations, deviations)
    assert np.max(np.abs(off)) < 1e-2
