"""The figures inside the covariances, against sums written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import (
    hac_covariance,
    influence,
    influence_of_stretches,
    long_run_covariance,
)
from modelgen.runtime.least_squares.orthogonal_solution import least_squares
from modelgen.runtime.numerics.bandwidth import scores_bandwidth, window_width
from modelgen.runtime.numerics.few_instants import KernelSums, joined_covariance
from modelgen.runtime.numerics.regressor import plain_regressors
from modelgen.runtime.rows.row_block import RowBlock

RNG = np.random.default_rng(8)
SERIES = [RNG.normal(size=(40, 2)).cumsum(axis=0), RNG.normal(size=(25, 2))]


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
    # the figures of `few_instants`, from sums over 1, 2, 3, .., 2, 1 neighbours, the kernel's root
    every = [
        np.column_stack([np.convolve(column, triangle) for column in psi.T]) / np.sqrt(triangle @ triangle)
        for psi in fading
    ]
    stride = max(1, window_width(bandwidth) // 2)
    sums = [KernelSums(one, psi[::stride], stride) for one, psi in zip(shares, every, strict=True)]
    expected = joined_covariance(sums, bandwidth, 65)
    assert np.all(np.diag(expected) > np.diag(sum(shares)))
    assert np.allclose(long_run_covariance(fading), expected, rtol=1e-10)


def fit_of_two_rows_and_two_records() -> Fit:
    """Return a fit whose blocks share instants within a record, and leave some of them out."""
    fields = {name: None for name in RowBlock.__dataclass_fields__}
    blocks, weights = [], (1.0, 0.5, 2.0)
    for record, grid in ((0, 30), (0, 30), (1, 20)):
        place = np.flatnonzero(RNG.random(grid) < 0.8)
        W, Y = RNG.normal(size=(place.size, 2)), RNG.normal(size=place.size)
        own = {"W": W, "Y": Y, "place": place, "grid": grid, "record": record, "opened": 0.0}
        blocks.append(RowBlock(**fields | own))
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


def test_stretches_of_a_record_hold_the_influence_of_their_time() -> None:
    fit = fit_of_two_rows_and_two_records()
    later = replace(fit, blocks=tuple(replace(block, start=4) for block in fit.blocks))
    series = influence(later)
    # every second sample from the fourth on, of records of 64 and 80 samples, in stretches of 16 and 20
    found = influence_of_stretches(later, series, (2, 3), (64, 80), 4)
    for psi, factor, length, sums in zip(series, (2, 3), (16, 20), found, strict=True):
        times = 4 + factor * np.arange(len(psi))
        for k in range(4):
            assert np.allclose(sums[k], psi[times // length == k].sum(axis=0), atol=1e-12)


def test_hac_counts_the_degrees_of_freedom_and_the_projected_columns() -> None:
    fit = fit_of_two_rows_and_two_records()
    r = sum(len(residual) for residual in fit.residuals)
    assert np.allclose(hac_covariance(fit), long_run_covariance(influence(fit)) * r / (r - 2), rtol=1e-12)
    whitened = replace(fit, lost=5)
    assert np.allclose(hac_covariance(whitened) * (r - 7), hac_covariance(fit) * (r - 2), rtol=1e-12)
    first, *others = fit.blocks
    opened = replace(fit, blocks=(replace(first, opened=2.5), *others))
    share = (r - 2.5) / (r - 4.5)
    assert np.allclose(hac_covariance(opened) * r / (r - 2), hac_covariance(fit) * share, rtol=1e-12)
    doubled = replace(fit, projected=plain_regressors(tuple(2.0 * block.W for block in fit.blocks)))
    assert np.allclose(np.concatenate(influence(doubled)), 2.0 * np.concatenate(influence(fit)))
