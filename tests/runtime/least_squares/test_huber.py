from __future__ import annotations

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.identification.robust_and_bounded import unweighted
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.huber import huber
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.rigid_motion import FS, RIGID, SETTINGS, TRUTH, rigid_record

COLUMNS = ("a", "b", "c")
X = np.array([1.0, -2.0, 3.0])


def fit_of(noise: np.ndarray, seed: int = 0) -> Fit:
    n = len(noise)
    W = np.random.default_rng(seed).standard_normal((n, 3))
    block = RowBlock(0, 0, "run", "m", "N", np.arange(n), n, W @ X + noise, W, 0, True, 1.0, 0)
    return fit_matched(Observation(COLUMNS, (block,)))


def test_the_estimate_is_that_of_statsmodels() -> None:
    sm = pytest.importorskip("statsmodels.api")
    noise = np.random.default_rng(1).standard_t(2, 400)
    fit = fit_of(noise)
    found, weights = huber(fit)
    (block,) = fit.blocks
    other = sm.RLM(block.Y, block.W, M=sm.robust.norms.HuberT()).fit(scale_est="mad", tol=1e-12, maxiter=500)
    # its scale is the median about the median; ours about zero, where a model's residual has its middle
    np.testing.assert_allclose(found.solution.x, other.params, atol=2e-3)
    np.testing.assert_allclose(weights[0], other.weights, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(hac_covariance(found))), other.bse, rtol=0.25)


@pytest.mark.slow
def test_outliers_are_weighed_down_and_the_interval_holds() -> None:
    rng = np.random.default_rng(2)
    inside, spreads = 0, []
    for seed in range(60):
        noise = rng.standard_normal(500)
        noise[rng.integers(0, 500, 40)] += 30.0
        fit = fit_of(noise, seed)
        found, weights = huber(fit)
        spread = np.sqrt(np.diag(hac_covariance(found)))
        inside += int(np.sum(np.abs(found.solution.x - X) < 1.96 * spread))
        spreads.append(np.sqrt(np.diag(hac_covariance(fit))) / spread)
        assert 0.02 < weights[0].min() < 0.1
    assert 0.90 <= inside / 180 <= 0.99
    # least squares pays for the outliers with intervals several times as wide
    assert np.mean(spreads) > 3.0


@pytest.mark.slow
def test_normal_noise_costs_five_percent_of_the_efficiency() -> None:
    plain, robust = [], []
    for seed in range(300):
        fit = fit_of(np.random.default_rng(1000 + seed).standard_normal(300), seed)
        plain.append(fit.solution.x - X)
        robust.append(huber(fit)[0].solution.x - X)
    assert np.var(plain) / np.var(robust) == pytest.approx(0.95, abs=0.03)


def test_spikes_in_the_force_no_longer_move_the_estimate() -> None:
    record = rigid_record()
    force = np.array(record.signals["F"])
    force[np.random.default_rng(0).integers(0, len(force), 60)] += 400.0
    spiky = Record({"q_m": record.signals["q_m"], "F": force}, FS, "spiky")
    plain = identify(RIGID, spiky, **values_of("wls", **SETTINGS))
    robust = identify(RIGID, spiky, **values_of("wls", robust="huber", **SETTINGS))
    for name, truth in TRUTH.items():
        assert abs(robust.params[name] - truth) < 4.0 * robust.bse[name]
        assert robust.bse[name] < 0.8 * plain.bse[name]
    assert abs(plain.params["offset"] - TRUTH["offset"]) > 3.0 * abs(
        robust.params["offset"] - TRUTH["offset"]
    )
    assert any(note.startswith("robust (Huber, 1.345)") for note in robust.fit.notes)


def test_what_the_estimate_leaves_of_the_rows_themselves_is_not_weighed() -> None:
    noise = np.random.default_rng(4).standard_t(2, 300)
    plain = fit_of(noise)
    robust, _ = huber(plain)
    back = unweighted(robust, plain)
    np.testing.assert_array_equal(back.blocks[0].W, plain.blocks[0].W)
    np.testing.assert_allclose(back.residuals[0], plain.blocks[0].Y - plain.blocks[0].W @ robust.solution.x)
    assert np.abs(back.residuals[0]).max() > 2.0 * np.abs(robust.residuals[0]).max()


def test_instruments_are_kept() -> None:
    record = rigid_record(n=12000, noise=1e-6)
    plain = identify(RIGID, record, **values_of("iv", **SETTINGS))
    robust = identify(RIGID, record, **values_of("iv", robust="huber", **SETTINGS))
    for name in TRUTH:
        assert robust.params[name] != plain.params[name]
        assert abs(robust.params[name] - plain.params[name]) < 3.0 * plain.bse[name]


@pytest.mark.parametrize(
    ("method", "options", "said"),
    [
        ("pham2002", {"robust": "huber"}, "does not go with method pham2002"),
        ("tls", {"robust": "huber"}, "does not go with method tls"),
        ("tls", {"bounds": "physical"}, "does not go with method tls"),
        ("wls", {"robust": "tukey"}, "is 'tukey'"),
        ("wls", {"bounds": "all"}, "is 'all'"),
    ],
)
def test_what_does_not_go_together_is_refused(method: str, options: dict[str, str], said: str) -> None:
    with pytest.raises(DataError, match=said):
        identify(RIGID, rigid_record(n=2000), **values_of(method, **options))
