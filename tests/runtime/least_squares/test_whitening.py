from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import cholesky, toeplitz
from scipy.signal import lfilter

from modelgen.runtime.least_squares import whitening
from modelgen.runtime.least_squares.thresholds import LEAST_POWER, WHITENING_ORDER
from modelgen.runtime.least_squares.whitening import Whitener, whitener

RNG = np.random.default_rng(3)


def test_the_predictor_of_an_autoregression_is_found() -> None:
    series = lfilter([1.0], [1.0, -1.2, 0.5], RNG.standard_normal(40_000))
    found = whitener([series], [np.arange(40_000)])
    assert len(found.predictors) == WHITENING_ORDER + 1
    np.testing.assert_allclose(found.predictors[2], [1.2, -0.5], atol=0.02)
    white = found(series, np.arange(40_000))
    assert np.std(white) == pytest.approx(1.0, rel=0.01)
    for lag in range(1, 5):
        assert abs(np.mean(white[lag:] * white[:-lag])) < 0.02


def test_whitening_is_the_inverse_factor_of_the_covariance_from_the_first_sample_on() -> None:
    a = np.array([0.9])
    known = Whitener((np.zeros(0), a), (1.0 / (1.0 - 0.81), 1.0))
    covariance = toeplitz(0.9 ** np.arange(12)) / (1.0 - 0.81)
    samples = RNG.standard_normal((12, 2))
    expected = np.linalg.solve(cholesky(covariance, lower=True), samples)
    np.testing.assert_allclose(known(samples, np.arange(12)), expected, rtol=1e-12)


def test_nothing_is_predicted_across_a_gap() -> None:
    series = lfilter([1.0], [1.0, -0.9], RNG.standard_normal(3000))
    place = np.r_[np.arange(1000), np.arange(1500, 1510), np.arange(1600, 3000)]
    found = whitener([series[place]], [place])
    white = found(series[place], place)
    for start, stop in ((0, 1000), (1000, 1010), (1010, len(place))):
        alone = found(series[place][start:stop], np.arange(stop - start))
        np.testing.assert_array_equal(white[start:stop], alone)


def test_short_stretches_are_made_as_white_as_long_ones() -> None:
    # noise that was differentiated twice has next to nothing at low frequencies
    noise = np.diff(RNG.standard_normal(40_000), n=2)
    place = np.flatnonzero(np.arange(len(noise)) % 40 < 25)
    white = np.zeros(len(noise))
    white[place] = whitener([noise[place]], [place])(noise[place], place)
    power = np.mean(white[place] ** 2)
    neighbours = [np.mean((white[lag:] * white[:-lag])[place[place % 40 < 25 - lag]]) for lag in range(1, 6)]
    assert power == pytest.approx(1.0, rel=0.03)
    assert np.max(np.abs(neighbours)) < 0.04


def test_a_short_or_silent_residual_is_only_scaled() -> None:
    short = whitener([np.array([2.0, -2.0, 2.0])], [np.arange(3)])
    np.testing.assert_allclose(short(np.array([2.0, 4.0, 6.0]), np.arange(3)), [1.0, 2.0, 3.0])
    silent = whitener([np.zeros(500)], [np.arange(500)])
    assert np.all(np.isfinite(silent(np.ones(500), np.arange(500))))


@pytest.mark.parametrize("gaps", [0, 3, 90])
@pytest.mark.parametrize("columns", [(), (3,)])
def test_blocks_and_stretches_at_once_give_the_sums_over_lags(
    monkeypatch: pytest.MonkeyPatch, gaps: int, columns: tuple[int, ...]
) -> None:
    monkeypatch.setattr(whitening, "PART", 128)
    rng = np.random.default_rng(gaps)
    place = np.setdiff1d(np.arange(700), rng.choice(700, gaps, replace=False))
    residual = np.convolve(rng.standard_normal(len(place) + 4), np.ones(5), "valid")
    found = whitener([residual], [place])
    stretches = np.split(residual, np.flatnonzero(np.diff(place) != 1) + 1)
    least = LEAST_POWER * float(residual @ residual)
    pairs, predictor = [(one[1:], one[:-1]) for one in stretches], np.zeros(0)
    for _ in range(found.order):
        product = sum(f @ b for f, b in pairs)
        reflection = 2.0 * product / (sum(f @ f + b @ b for f, b in pairs) + least)
        pairs = [((f - reflection * b)[1:], (b - reflection * f)[:-1]) for f, b in pairs]
        predictor = np.append(predictor - reflection * predictor[::-1], reflection)
    assert np.allclose(found.predictors[-1], predictor, rtol=0.0, atol=1e-11)
    samples, first = rng.standard_normal((len(place), *columns)), 0
    white = found(samples, place)
    for stretch in stretches:
        for k in range(len(stretch)):
            known = min(k, found.order)
            lags = samples[first + k - known : first + k][::-1]
            left = samples[first + k] - found.predictors[known] @ lags
            assert white[first + k] == pytest.approx(left / np.sqrt(found.variances[known]), rel=1e-9)
        first += len(stretch)


def test_stretches_are_whitened_together_as_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    series = lfilter([1.0], [1.0, -1.2, 0.5], RNG.standard_normal((2000, 3)), axis=0)
    # 200 stretches of which some are shorter than the order
    place = np.arange(2000) + np.searchsorted(np.sort(RNG.choice(2000, 200, replace=False)), np.arange(2000))
    found, calls = whitener([series[:, 0]], [place]), list[int]()
    product = whitening.product
    monkeypatch.setattr(whitening, "product", lambda *given: calls.append(1) or product(*given))
    white = found(series, place)
    # the time of a product is that of its call, where stretches are short
    assert len(calls) == 1
    for run in np.split(np.arange(2000), np.flatnonzero(np.diff(place) > 1) + 1):
        np.testing.assert_allclose(
            white[run], found(series[run], np.arange(len(run))), rtol=1e-12, atol=1e-12
        )
