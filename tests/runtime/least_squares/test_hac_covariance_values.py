"""The figures inside the covariances, against sums written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import (
    effective_instants,
    fixed_b_factor,
    hac_covariance,
    influence,
    joined_covariance,
    long_run_covariance,
    squared_sums,
)
from modelgen.runtime.least_squares.orthogonal_solution import least_squares
from modelgen.runtime.numerics.bandwidth import scores_bandwidth, window_width
from modelgen.runtime.numerics.regressor import plain_regressors
from modelgen.runtime.rows.row_block import RowBlock

RNG = np.random.default_rng(8)
SERIES = [RNG.normal(size=(40, 2)).cumsum(axis=0), RNG.normal(size=(25, 2))]


@pytest.mark.parametrize(
    ("bandwidth", "n", "quantile"),
    [(0.0, 10, 1.96), (2.0, 10, 2.423312), (5.0, 10, 3.407225), (10.0, 10, 5.6732), (30.0, 10, 5.6732)],
)
def test_the_fixed_b_factor_is_the_square_of_a_ratio_of_quantiles(
    bandwidth: float, n: int, quantile: float
) -> None:
    assert fixed_b_factor(bandwidth, n) == pytest.approx((quantile / 1.96) ** 2, rel=1e-9)


def test_the_long_run_covariance_is_a_double_sum_over_instants() -> None:
    # little is left of both behind a few instants: less than there are count
    fading = [RNG.normal(size=psi.shape) * np.exp(-np.arange(len(psi)) / 4.0)[:, None] for psi in SERIES]
    bandwidth = scores_bandwidth(fading)
    triangle = np.convolve(np.ones(window_width(bandwidth)), np.ones(window_width(bandwidth)))
    kernel = np.correlate(triangle, triangle, "full")[len(triangle) - 1 :] / (triangle @ triangle)
    kernel = np.append(kernel, np.zeros(40))
    shares = []
    for psi in fading:
        share = np.zeros((2, 2))
        for i, here in enumerate(psi):
            for j, there in enumerate(psi):
                share += kernel[abs(i - j)] * np.outer(here, there)
        shares.append(share)
    power, expected = np.diag(sum(shares)), np.zeros((2, 2))
    for psi, share in zip(fading, shares, strict=True):
        # a sum over 1, 2, 3, .., 2, 1 neighbours, the kernel's root
        sums = np.column_stack([np.convolve(column, triangle) for column in psi.T])
        fourth = np.sum(sums**4, axis=0) / (triangle @ triangle) ** 2
        instants = 3.0 * np.sum(np.diag(share) / power) / np.sum(fourth / power**2)
        assert instants < 60.0
        expected += share * fixed_b_factor(bandwidth, instants)
    assert np.allclose(long_run_covariance(fading), expected, rtol=1e-10)


def test_normal_noise_counts_every_instant_and_a_burst_its_own() -> None:
    noise = RNG.normal(size=(20_000, 1))
    burst = noise * (np.arange(20_000) < 2_000)[:, None]
    for psi, count in ((noise, 20_000), (burst, 2_000)):
        sums = squared_sums(psi, 1)
        assert sums.total[0, 0] == pytest.approx(np.sum(psi**2))
        found = effective_instants(1.0, float(sums.fourth[0] / sums.total[0, 0] ** 2), 20_000)
        assert found == pytest.approx(count, rel=0.06)
    # never more than there are, and all where there is nothing
    assert effective_instants(1.0, 1e-3, 100) == 100.0
    assert effective_instants(0.0, 0.0, 7) == 7.0


def test_every_record_is_judged_by_its_own_instants() -> None:
    long, short = RNG.normal(size=(5_000, 1)), 30.0 * RNG.normal(size=(40, 1))
    # the second column rests on the short record, the first on the long one; the third is dead
    series = [np.hstack([long, 1e-6 * long, 0.0 * long]), np.hstack([1e-6 * short, short, 0.0 * short])]
    sums = [squared_sums(psi, 1) for psi in series]
    found = joined_covariance(sums, 2.0, 5_040)
    assert found[0, 0] / sums[0].total[0, 0] == pytest.approx(fixed_b_factor(2.0, 5_000), rel=1e-3)
    assert found[1, 1] / sums[1].total[1, 1] == pytest.approx(fixed_b_factor(2.0, 40), rel=0.05)
    assert found[1, 1] > 1.05 * sums[1].total[1, 1]
    assert not found[2].any()
    # alike twice: as if it were one record of twice the length
    twice = joined_covariance([sums[1]] * 2, 2.0, 5_040)
    assert twice[1, 1] / (2.0 * sums[1].total[1, 1]) == pytest.approx(fixed_b_factor(2.0, 80), rel=0.03)


def fit_of_two_rows_and_two_records() -> Fit:
    """Return a fit whose blocks share instants within a record, and leave some of them out."""
    fields = {name: None for name in RowBlock.__dataclass_fields__}
    blocks, weights = [], (1.0, 0.5, 2.0)
    for record, grid in ((0, 30), (0, 30), (1, 20)):
        place = np.flatnonzero(RNG.random(grid) < 0.8)
        W, Y = RNG.normal(size=(place.size, 2)), RNG.normal(size=place.size)
        blocks.append(RowBlock(**{**fields, "W": W, "Y": Y, "place": place, "grid": grid, "record": record}))
    W = np.concatenate([w * b.W for w, b in zip(weights, blocks, strict=True)])
    Y = np.concatenate([w * b.Y for w, b in zip(weights, blocks, strict=True)])
    solution = least_squares(W, Y)
    residuals = tuple(block.Y - block.W @ solution.x for block in blocks)
    return Fit(("a", "b"), (), solution, tuple(blocks), weights, residuals)


def test_influence_adds_up_the_rows_of_an_instant() -> None:
    fit = fit_of_two_rows_and_two_records()
    series = influence(fit)
    assert [psi.shape for psi in series] == [(30, 2), (20, 2)]
    expected = [np.zeros((30, 2)), np.zeros((20, 2))]
    for block, weight, residual in zip(fit.blocks, fit.weights, fit.residuals, strict=True):
        for place, row, e in zip(block.place, block.W, residual, strict=True):
            expected[block.record][place] += weight**2 * e * fit.solution.inverse @ row
    for found, wanted in zip(series, expected, strict=True):
        assert np.allclose(found, wanted, rtol=1e-12, atol=1e-15)


def test_hac_counts_the_degrees_of_freedom_and_the_projected_columns() -> None:
    fit = fit_of_two_rows_and_two_records()
    r = sum(len(residual) for residual in fit.residuals)
    assert np.allclose(hac_covariance(fit), long_run_covariance(influence(fit)) * r / (r - 2), rtol=1e-12)
    whitened = replace(fit, lost=5)
    assert np.allclose(hac_covariance(whitened) * (r - 7), hac_covariance(fit) * (r - 2), rtol=1e-12)
    doubled = replace(fit, projected=plain_regressors(tuple(2.0 * block.W for block in fit.blocks)))
    assert np.allclose(np.concatenate(influence(doubled)), 2.0 * np.concatenate(influence(fit)))
