"""What hardly known directions reach: as far as reciprocals do; what is known well stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.modes.thresholds import FARTHEST, Z95
from modelgen.runtime.modes.uncertain_chain import UncertainChain, loose_part


def chain_of(values: np.ndarray, root: np.ndarray, composites: bool = True) -> UncertainChain:
    none = np.zeros((len(values), 0))
    names = tuple(f"p{k}" for k in range(len(values)))
    return UncertainChain(names, values, root, none, none, loose_part(values, root) if composites else None)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_known_well_is_not_changed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.uniform(-1.0, 1.0, 3) * 10.0 ** rng.uniform(-6, 6, 3)
    root = 0.03 * np.abs(values)[:, None] * rng.standard_normal((3, 3))
    np.testing.assert_array_equal(chain_of(values, root).cautious_root, root)
    np.testing.assert_array_equal(chain_of(values, 30.0 * root, composites=False).cautious_root, 30.0 * root)


@pytest.mark.parametrize("seed", range(20))
def test_only_the_direction_that_is_hardly_known_reaches_further(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = 10.0 ** rng.uniform(-6, 6, 3)
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    root = values[:, None] * axes * [rng.uniform(0.25, 2.0), 0.02, 0.01]
    wider = (chain_of(values, root).cautious_root / values[:, None]).T @ axes
    before = (root / values[:, None]).T @ axes
    np.testing.assert_allclose(wider[1:], before[1:], atol=1e-12)
    assert 1.0 <= wider[0, 0] / before[0, 0] <= np.log(FARTHEST) / (Z95 * 0.25 * np.sqrt(1.0 / 3.0))


def test_a_number_whose_reciprocal_is_normal_is_held() -> None:
    """As often as it should be, where deviations as stated at the estimate hold it too seldom."""
    rng, spread = np.random.default_rng(1), 0.3
    held = np.zeros((2000, 2))
    for k, reciprocal in enumerate(1.0 + spread * rng.standard_normal(2000)):
        estimate = np.array([1.0 / reciprocal])
        root = np.array([[spread * estimate[0] ** 2]])
        for j, one in enumerate((root, chain_of(estimate, root).cautious_root)):
            held[k, j] = abs(estimate[0] - 1.0) <= Z95 * abs(one[0, 0])
    linear, cautious = held.mean(axis=0)
    assert linear < 0.93 <= cautious <= 0.98
