"""What is near to a fit: deviations of rows that are not white, covariances that come back as they were."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.identification.methods import WLS, run_wls
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.parameters.row_metric import RowMetric
from tests.runtime.parameters.test_consistent_fit import FILTERS, QUICK, made


@pytest.fixture(scope="module")
def fit() -> Fit:
    """An arm with springs: rows of its links hold noise of encoders, differentiated twice."""
    model, record, _ = made(True, 0.3)
    return run_wls(prepared(model, record, WLS(), FILTERS, QUICK).job)[1]


def test_deviations_are_those_of_coloured_rows(fit: Fit) -> None:
    c = len(fit.columns)
    stated = np.sqrt(np.diag(hac_covariance(fit)))
    white = np.linalg.norm(np.linalg.inv(fit.triangle[:c, :c]), axis=1) * fit.residual_norm
    white /= np.sqrt(fit.count - c)
    found = np.linalg.norm(np.linalg.inv(RowMetric(fit).whitening), axis=1)
    assert np.max(white / stated) > 3.0 and np.min(white / stated) < 0.4
    assert np.max(found / stated) < 1.5 and np.min(found / stated) > 0.6


def test_sums_that_rows_tell_stay_told(fit: Fit) -> None:
    """Directions of the rows are known to within the square root of their largest change of size."""
    c = len(fit.columns)
    rows = np.linalg.solve(RowMetric(fit).whitening.T, fit.triangle[:c, :c].T)
    sizes = np.linalg.svd(rows, compute_uv=False)
    assert sizes[0] / sizes[-1] < 30.0


def test_covariances_come_back_and_no_spread_halves_them(fit: Fit) -> None:
    metric = RowMetric(fit)
    covariance = np.linalg.inv(metric.whitening.T @ metric.whitening)
    # as much as the metric says: the fit's own inverse
    same = metric.inverse_within(covariance)
    size = np.sqrt(np.diag(fit.solution.inverse))
    np.testing.assert_allclose(
        same / np.outer(size, size), fit.solution.inverse / np.outer(size, size), atol=1e-6
    )
    # the mean with none is half the covariance, of the root of a half of the inverse
    none = metric.inverse_within(np.zeros_like(covariance))
    np.testing.assert_allclose(
        none / np.outer(size, size), same / np.outer(size, size) / np.sqrt(2.0), atol=1e-6
    )
