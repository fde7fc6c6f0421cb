"""Slopes of pairs of poles against differences, through critical damping."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.modes.pole_pairs import _assigned, pair_slopes, pole_pairs, undamped_modes


@pytest.mark.parametrize("seed", range(30))
def test_slopes_are_those_of_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    inertia = rng.uniform(0.5, 2.0, n)
    levers = rng.normal(size=(n, n))
    grounded = rng.normal(size=n)
    springs = [10.0 * np.outer(lever, lever) for lever in levers[: max(n - 1, 1)]]
    K = sum(springs) + np.outer(grounded, grounded) * (seed % 2)
    # from light to critical and beyond
    D = 10.0 ** rng.uniform(-2.0, 1.0) * np.diag(rng.uniform(0.5, 1.5, n))
    modes = undamped_modes(inertia, K)
    pairs = pole_pairs(inertia, D, K, modes)
    none = np.zeros((n, n))
    change = (rng.normal(size=n) * 0.1, 0.1 * np.diag(rng.normal(size=n)), 0.1 * springs[0])
    parts = [(change[0], none, none), (0.0 * change[0], change[1], none), (0.0 * change[0], none, change[2])]
    for k, pair in enumerate(pairs):
        slopes = pair_slopes(inertia, D, K, modes, [pair], parts)[0]
        for j, (dM, dD, dK) in enumerate(parts):
            ends = [pole_pairs(inertia + h * dM, D + h * dD, K + h * dK, modes)[k] for h in (1e-5, -1e-5)]
            size = max(abs(pair.sum), abs(pair.product), 1.0)
            assert slopes[0, j] == pytest.approx((ends[0].sum - ends[1].sum) / 2e-5, abs=1e-4 * size)
            product = (ends[0].product - ends[1].product) / 2e-5
            assert slopes[1, j] == pytest.approx(product, abs=1e-4 * size)


def test_a_free_chain_keeps_a_pole_at_zero_exactly() -> None:
    for D in (np.zeros((2, 2)), np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([1.0, 0.0])):
        K = 100.0 * np.array([[1e-4, -1e-2], [-1e-2, 1.0]])
        modes = undamped_modes(np.array([1e-3, 2.0]), K)
        free = pole_pairs(np.array([1e-3, 2.0]), D, K, modes)[0]
        assert free.product == 0.0
        assert modes.squares[0] == 0.0


def test_few_poles_are_given_to_modes_as_an_optimizer_gives_them() -> None:
    from scipy.optimize import linear_sum_assignment

    rng = np.random.default_rng(0)
    for rows, columns in ((2, 2), (2, 4), (3, 5), (4, 5), (5, 6), (3, 2)):
        for _ in range(20):
            # all modes prefer the first pole
            shares = rng.uniform(size=(rows, columns)) + np.r_[1.0, np.zeros(columns - 1)]
            best = linear_sum_assignment(-shares)
            assert _assigned(shares) == list(zip(best[1].tolist(), best[0].tolist(), strict=True))
