"""Variances that rest on few instants grow, each direction by its own factor."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm
from scipy.stats import t as student

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.numerics.few_instants import (
    KEPT_SUMS,
    EveryFew,
    KernelSums,
    effective_instants,
    fixed_b_factor,
    joined_covariance,
)

RNG = np.random.default_rng(8)


@pytest.mark.parametrize(
    ("bandwidth", "n", "quantile"),
    [(0.0, 10, 1.96), (2.0, 10, 2.423312), (5.0, 10, 3.407225), (10.0, 10, 5.6732), (30.0, 10, 5.6732)],
)
def test_the_fixed_b_factor_is_the_square_of_a_ratio_of_quantiles(
    bandwidth: float, n: int, quantile: float
) -> None:
    assert fixed_b_factor(bandwidth, n) == pytest.approx((quantile / 1.96) ** 2, rel=1e-9)


@pytest.mark.parametrize("b", [0.0, 0.02, 0.1, 0.2])
def test_beyond_95_percent_the_tail_is_that_of_students_distribution(b: float) -> None:
    usual = 1.96 * np.sqrt(fixed_b_factor(b, 1.0))
    degrees = brentq(lambda v: student.ppf(norm.cdf(1.96), v) - usual, 1.0, 1e9) if b else 1e9
    for level in (0.01, 0.001, 0.0005):
        z = float(norm.isf(0.5 * level))
        quantile = z * np.sqrt(fixed_b_factor(b, 1.0, z))
        assert quantile == pytest.approx(student.isf(0.5 * level, degrees), rel=0.06)


def sums_of(psi: FloatArray) -> KernelSums:
    return KernelSums(psi.T @ psi, psi)


def test_normal_noise_counts_every_instant_and_a_burst_its_own() -> None:
    noise = RNG.normal(size=(20_000, 2))
    noise[2_000:, 1] = 0.0
    found = effective_instants(np.sum(noise**2, axis=0), np.sum(noise**4, axis=0), 20_000)
    assert found == pytest.approx([20_000, 2_000], rel=0.06)
    # never more than there are, and all where there is nothing
    assert effective_instants(np.array([1.0, 0.0]), np.array([1e-3, 0.0]), 100).tolist() == [100.0, 100.0]


def test_every_direction_has_instants_of_its_own() -> None:
    long, short = RNG.normal(size=(5_000, 1)), 30.0 * RNG.normal(size=(40, 1))
    # the second column rests on the short record, the first on the long one; the third is dead
    series = [np.hstack([long, 0.0 * long, 0.0 * long]), np.hstack([0.0 * short, short, 0.0 * short])]
    mixed = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for mix in (np.eye(3), mixed):
        sums = [sums_of(psi @ mix.T) for psi in series]
        total = sums[0].total + sums[1].total
        found = joined_covariance(sums, 2.0, 5_040)
        # undone, the mix leaves what the columns themselves have
        back = np.linalg.inv(mix)
        found, total = back @ found @ back.T, back @ total @ back.T
        assert found[0, 0] / total[0, 0] == pytest.approx(fixed_b_factor(2.0, 5_000), rel=5e-3)
        assert found[1, 1] / total[1, 1] == pytest.approx(fixed_b_factor(2.0, 40), rel=0.08)
        assert not found[2].any()


def test_directions_that_no_kept_instant_reaches_grow_as_the_others_do() -> None:
    psi = np.random.default_rng(9).normal(size=(400, 40))
    unreached = np.linalg.svd(psi[::25])[2][16:]
    growth = []
    for order in (np.arange(40), np.arange(40)[::-1]):
        sums = KernelSums(psi[:, order].T @ psi[:, order], psi[::25, order], 25)
        found = joined_covariance([sums], 100.0, 400)
        along = unreached[:, order]
        growth.append(np.diag(along @ found @ along.T) / np.diag(along @ sums.total @ along.T))
    # rounding, which another order of the columns changes, does not tell one of them from another
    assert np.ravel(growth) == pytest.approx(np.full(48, growth[0][0]), rel=1e-9)


def test_sums_that_nearly_cancel_grow_no_more_than_their_parts() -> None:
    common = RNG.normal(size=(300, 1)) * (np.arange(300) < 30)[:, None]
    psi = common + 1e-2 * RNG.normal(size=(300, 2))
    sums = sums_of(psi)
    found = joined_covariance([sums], 10.0, 300)
    factors = [
        float(a @ found @ a / (a @ sums.total @ a)) for a in (np.array([1.0, 0.0]), np.array([1.0, -1.0]))
    ]
    assert factors[0] > 1.8
    assert factors[1] < 1.3


def test_what_every_instant_tells_hardly_grows() -> None:
    psi = RNG.normal(size=(50_000, 2))
    found = joined_covariance([sums_of(psi)], 10.0, 50_000)
    assert np.allclose(found, psi.T @ psi, rtol=1e-3)


def test_instants_that_are_kept_do_not_depend_on_parts() -> None:
    series = np.arange(3 * KEPT_SUMS, dtype=float)[:, None]
    kept = []
    for size in (len(series), 1000):
        few = EveryFew(2)
        for start in range(0, len(series), size):
            few.add(series[start : start + size])
        assert np.array_equal(few.result(), series[:: few.stride])
        assert len(few.result()) <= KEPT_SUMS
        kept.append(few.stride)
    assert kept[0] == kept[1] == 4


def test_intervals_hold_of_what_one_burst_tells() -> None:
    """Least squares of a column that fades and one that lasts: 95 % intervals hold of both."""
    rng, held, tries = np.random.default_rng(4), np.zeros(2), 500
    t = np.arange(600)
    W = np.column_stack([np.exp(-t / 60.0), np.sin(0.3 * t)])
    inverse = np.linalg.inv(W.T @ W)
    for _ in range(tries):
        noise = rng.normal(size=600)
        x = inverse @ (W.T @ noise)
        psi = (W * (noise - W @ x)[:, None]) @ inverse
        held += np.abs(x) < 1.96 * np.sqrt(np.diag(long_run_covariance([psi])))
    assert np.all(np.abs(held / tries - 0.95) < 0.03)
