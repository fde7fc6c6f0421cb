from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.heterogeneity import heterogeneity, holm


@pytest.mark.slow
def test_holm_is_that_of_statsmodels() -> None:
    from statsmodels.stats.multitest import multipletests  # takes seconds to import

    rng = np.random.default_rng(3)
    for count in range(1, 20):
        p_values = (rng.uniform(size=count) ** 3).round(3)  # some alike, some zero
        expected = multipletests(p_values, method="holm")[1]
        np.testing.assert_allclose(holm(p_values.tolist()), expected, rtol=1e-12)


def test_equal_estimates_are_pooled_by_precision() -> None:
    rng = np.random.default_rng(0)
    p_values = []
    for _ in range(400):
        variances = rng.uniform(0.5, 4.0, 8)
        found = heterogeneity(3.0 + rng.standard_normal(8) * np.sqrt(variances), variances)
        p_values.append(found.p_value)
        assert found.std >= (1.0 / (1.0 / variances).sum()) ** 0.5 * (1 - 1e-12)
    assert np.mean(np.array(p_values) < 0.05) == pytest.approx(0.05, abs=0.03)


def test_a_spread_is_found_in_its_size_and_widens_the_mean() -> None:
    rng = np.random.default_rng(1)
    values = rng.standard_normal(400) * 3.0 + rng.standard_normal(400)
    found = heterogeneity(values, np.ones(400))
    assert found.p_value < 1e-6
    assert found.between_std == pytest.approx(3.0, rel=0.1)
    assert found.std == pytest.approx(10.0**0.5 / 20.0, rel=0.1)


def test_groups_have_means_of_their_own() -> None:
    values = np.array([0.0, 0.1, 10.0, 10.1])
    assert heterogeneity(values, np.ones(4)).p_value < 1e-6
    assert heterogeneity(values, np.ones(4), np.array([0, 0, 1, 1])).p_value > 0.9
    alone = heterogeneity(values, np.ones(4), np.arange(4))
    assert (alone.p_value, alone.between_std) == (1.0, 0.0)
