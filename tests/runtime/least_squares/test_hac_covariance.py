from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import (
    hac_covariance,
    influence,
    printed_covariance,
)
from modelgen.runtime.least_squares.wls import fit_paper
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock


def autoregression(rng: np.random.Generator, n: int, rho: float) -> np.ndarray:
    series = np.zeros(n)
    for k, step in enumerate(rng.standard_normal(n)):
        series[k] = rho * series[k - 1] + step if k else step / np.sqrt(1.0 - rho**2)
    return series


def fit_of(W: np.ndarray, Y: np.ndarray, place: np.ndarray | None = None, grid: int | None = None) -> Fit:
    block = RowBlock(
        record=0,
        row=0,
        record_name="record",
        row_name="row",
        unit="N",
        place=np.arange(len(Y)) if place is None else place,
        grid=len(Y) if grid is None else grid,
        Y=Y,
        W=W,
        masked=0,
        has_force=True,
        force_scale=1.0,
        differentiated=0,
    )
    return fit_paper(Observation(tuple(f"x{i}" for i in range(W.shape[1])), (block,)))


def test_printed_covariance_is_equation_11_with_either_degree_of_freedom() -> None:
    rng = np.random.default_rng(0)
    W, Y = rng.standard_normal((60, 3)), rng.standard_normal(60)
    fit = fit_of(W, Y)
    residual = Y - W @ fit.solution.x
    for name, lost in (("r-c", 3), ("r-1", 1)):
        sigma, covariance = printed_covariance(fit, name)
        assert sigma**2 == pytest.approx(residual @ residual / (60 - lost))
        np.testing.assert_allclose(covariance, sigma**2 * np.linalg.inv(W.T @ W))


def test_influence_sums_to_zero_and_leaves_gaps_where_samples_are_masked() -> None:
    rng = np.random.default_rng(1)
    place = np.array([0, 1, 2, 7, 8, 9])
    fit = fit_of(rng.standard_normal((6, 2)), rng.standard_normal(6), place, grid=10)
    (psi,) = influence(fit)
    assert psi.shape == (10, 2)
    np.testing.assert_array_equal(psi[3:7], 0.0)
    np.testing.assert_allclose(psi.sum(axis=0), 0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "covered"), [(0.0, (0.91, 0.98)), (0.8, (0.88, 0.97))])
def test_intervals_hold_the_truth_as_often_as_they_say(rho: float, covered: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    hits, printed_hits = [], []
    for _ in range(300):
        W = np.column_stack([np.ones(600), autoregression(rng, 600, rho)])
        fit = fit_of(W, W @ np.array([1.0, 2.0]) + autoregression(rng, 600, rho))
        error = np.abs(fit.solution.x - [1.0, 2.0])
        hits.append(error < 1.96 * np.sqrt(np.diag(hac_covariance(fit))))
        printed_hits.append(error < 1.96 * np.sqrt(np.diag(printed_covariance(fit)[1])))
    low, high = covered
    assert np.all(np.mean(hits, axis=0) > low)
    assert np.all(np.mean(hits, axis=0) < high)
    # what eq. (11) promises for coloured residuals is not kept
    assert (np.mean(printed_hits, axis=0) < 0.75).all() == (rho > 0.0)


@pytest.mark.slow
def test_a_parameter_that_few_instants_tell_of_has_an_honest_interval() -> None:
    rng = np.random.default_rng(6)
    # twelve instants of six hundred say nearly everything about the second column
    W = np.column_stack([np.ones(600), np.where(np.arange(600) % 50 == 0, 1.0, 0.01)])
    hits = []
    for _ in range(1500):
        fit = fit_of(W, W @ np.array([1.0, 2.0]) + rng.standard_normal(600))
        hits.append(abs(fit.solution.x[1] - 2.0) < 1.96 * np.sqrt(hac_covariance(fit)[1, 1]))
    # counted as six hundred it would be 0.913
    assert 0.925 < np.mean(hits) < 0.965


def test_differentiated_noise_does_not_widen_the_interval_of_a_mean() -> None:
    rng = np.random.default_rng(5)
    found, errors = [], []
    for _ in range(200):
        noise = rng.standard_normal(1002)
        fit = fit_of(np.ones((1000, 1)), 0.2 * rng.standard_normal(1000) + np.diff(noise, 2))
        errors.append(fit.solution.x[0])
        found.append(hac_covariance(fit)[0, 0])
    # a triangle as kernel makes it 1.5 times too wide
    assert 0.8 < np.sqrt(np.mean(found)) / np.std(errors) < 1.3


def test_residuals_of_changing_size_widen_the_interval() -> None:
    rng = np.random.default_rng(4)
    x = rng.standard_normal(5000)
    fit = fit_of(x[:, None], 2.0 * x + x * rng.standard_normal(5000))
    assert hac_covariance(fit)[0, 0] / printed_covariance(fit)[1][0, 0] == pytest.approx(3.0, rel=0.2)
