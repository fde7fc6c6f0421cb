from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.total_least_squares import fit_total
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.rigid_motion import RIGID, SETTINGS, TRUTH, rigid_record

X = np.array([95.0, 200.0, 20.0, -3.0])
SIZES = np.array([0.4, 0.1, 1.0, 1.0])


def fit_of(seed: int, share: float, n: int = 2000) -> Fit:
    """Columns of the rigid model: two with noise of a share of their size, a sign, a constant; Y alike."""
    rng = np.random.default_rng(seed)
    clean = np.column_stack([rng.standard_normal((n, 2)), np.sign(rng.standard_normal(n)), np.ones(n)])
    clean = clean * SIZES
    Y = clean @ X
    noise = rng.standard_normal((n, 3)) * share
    W = clean.copy()
    W[:, :2] += noise[:, :2] * SIZES[:2]
    Y = Y + noise[:, 2] * float(np.sqrt(np.mean(Y**2)))
    block = RowBlock(0, 0, "run", "m", "N", np.arange(n), n, Y, W, 0, True, 1.0, 0)
    return fit_matched(Observation(RIGID.base_parameters, (block,)))


def test_without_noise_it_is_least_squares() -> None:
    fit = fit_of(0, 0.0)
    np.testing.assert_allclose(fit_total(fit, RIGID).solution.x, X, rtol=1e-9)


def test_noise_in_the_columns_biases_least_squares_but_not_this() -> None:
    least, total, inside = [], [], []
    for seed in range(60):
        fit = fit_of(seed, 0.2)
        found = fit_total(fit, RIGID)
        least.append(fit.solution.x)
        total.append(found.solution.x)
        spread = np.sqrt(np.diag(hac_covariance(found)))
        inside.append(np.abs(found.solution.x - X) < 1.96 * spread)
    # 4 % of the power is noise
    assert np.mean(least, axis=0)[0] < 0.97 * X[0]
    standard_error = np.std(total, axis=0) / np.sqrt(60.0)
    assert np.all(np.abs(np.mean(total, axis=0) - X) < 3.5 * standard_error)
    assert np.all(np.mean(inside, axis=0) > 0.88)
    assert np.mean(inside) < 0.99


@pytest.mark.slow
def test_its_standard_deviations_are_those_of_many_records() -> None:
    values, claimed = [], []
    for seed in range(150):
        found = fit_total(fit_of(seed, 0.3, n=1000), RIGID)
        values.append(found.solution.x)
        claimed.append(np.sqrt(np.diag(hac_covariance(found))))
    np.testing.assert_allclose(np.mean(claimed, axis=0), np.std(values, axis=0), rtol=0.17)
    # noise as large as this is beyond first order, but not far: with the columns as measured, 1.66
    loud = [fit_total(fit_of(seed, 0.6, n=1000), RIGID) for seed in range(150)]
    spread = float(np.std([one.solution.x[0] for one in loud]))
    assert np.mean([np.sqrt(hac_covariance(one)[0, 0]) for one in loud]) < 1.4 * spread


def test_its_inverse_is_that_of_the_columns_without_their_noise() -> None:
    found = fit_total(fit_of(0, 0.5, n=40000), RIGID)
    # the clean columns are independent, and their lengths are known
    np.testing.assert_allclose(40000.0 * np.diag(found.solution.inverse), SIZES**-2.0, rtol=0.03)


def test_columns_without_noise_stay_exact() -> None:
    # with the sign and the constant counted among the noisy columns the fit would be another one
    fit = fit_of(1, 0.3)
    found = fit_total(fit, RIGID)
    residual = found.residuals[0]
    # exact columns are orthogonal to what is left, as in least squares
    for column in fit.blocks[0].W[:, 2:].T:
        assert abs(float(column @ residual)) < 1e-8 * np.linalg.norm(column) * np.linalg.norm(residual)
    assert abs(float(fit.blocks[0].W[:, 0] @ residual)) > 1e-3 * np.linalg.norm(residual)


def test_dependent_columns_have_no_solution() -> None:
    fit = fit_of(2, 0.0)
    block = fit.blocks[0]
    W = block.W.copy()
    W[:, 1] = W[:, 0]
    with pytest.raises(IdentifiabilityError, match="columns are dependent"):
        fit_total(replace(fit, blocks=(replace(block, W=W),)), RIGID)


def test_delays_are_not_estimated_with_it() -> None:
    with pytest.raises(DataError, match="not estimated with method tls"):
        identify(RIGID, rigid_record(n=3000), **values_of("tls", delays="estimate", **SETTINGS))


def test_the_method_says_what_it_is() -> None:
    estimate = identify(RIGID, rigid_record(), **values_of("tls", **SETTINGS))
    for name, truth in TRUTH.items():
        assert estimate.params[name] == pytest.approx(truth, rel=0.02)
    assert any("a comparison, not an estimate to rely on" in note for note in estimate.fit.notes)
    # what pruning keeps is estimated by the same method
    kept = {name: value for name, value, _ in estimate.fit.pruning.kept}
    assert kept == pytest.approx(dict(estimate.params), rel=1e-9)
