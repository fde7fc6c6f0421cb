"""How long scores stay correlated, seen by an autoregression and by the growth of their covariance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.numerics import bandwidth
from modelgen.runtime.numerics.bandwidth import (
    LARGEST_CORRELATION,
    LONGEST_WINDOW,
    WIDER,
    bandwidth_from_moments,
    moving_sum,
    scores_bandwidth,
    window_power,
)


def autoregression(rng: np.random.Generator, n: int, rho: float) -> np.ndarray:
    series = np.zeros(n)
    for k, step in enumerate(rng.standard_normal(n)):
        series[k] = rho * series[k - 1] + step if k else step / np.sqrt(1.0 - rho**2)
    return series


def test_bandwidth_is_one_for_white_noise_and_grows_with_correlation() -> None:
    rng = np.random.default_rng(2)
    white, coloured = (autoregression(rng, 4000, rho)[:, None] for rho in (0.0, 0.8))
    assert scores_bandwidth([white]) < 4.0 * WIDER
    # Andrews (1991), eq. (6.4) for an exact autoregression with rho = 0.8
    exact = WIDER * 2.6614 * (4.0 * 0.8**2 / (1 - 0.8) ** 4 * 4000) ** (1.0 / 5.0)
    assert scores_bandwidth([coloured]) == pytest.approx(exact, rel=0.15)
    assert scores_bandwidth([np.zeros((10, 2))]) == 1.0


def test_causes_of_a_residual_are_compared_behind_a_window_that_none_of_them_makes_longer() -> None:
    rng = np.random.default_rng(3)
    slow = np.repeat(rng.standard_normal(40), 100)  # what one cause would explain
    series = [(rng.standard_normal(4000) + 0.5 * slow)[:, None]]
    short, long = scores_bandwidth(series, grown=False), scores_bandwidth(series)
    assert short < 0.5 * long
    white = [rng.standard_normal((4000, 1))]
    assert scores_bandwidth(white) == scores_bandwidth(white, grown=False)
    assert long_run_covariance(series, grown=False)[0, 0] < 0.5 * long_run_covariance(series)[0, 0]


def test_the_bandwidth_is_andrews_formula_written_out() -> None:
    power, product, n = np.array([4.0, 1.0, 0.0]), np.array([2.0, -0.3, 0.0]), 1000
    rho = [0.5, -0.3]
    numerator = sum(4 * r**2 * (1 - r**2) ** 2 / (1 - r) ** 8 for r in rho)
    denominator = sum((1 - r**2) ** 2 / (1 - r) ** 4 for r in rho)
    expected = 2.6614 * (numerator / denominator * n) ** (1 / 5)
    found = bandwidth_from_moments(power, product, n)
    assert found in (pytest.approx(expected), pytest.approx(WIDER * expected))


def test_a_correlation_near_one_is_bounded() -> None:
    at_bound = bandwidth_from_moments(np.array([1.0]), np.array([LARGEST_CORRELATION]), 500)
    assert bandwidth_from_moments(np.array([1.0]), np.array([0.999]), 500) == at_bound
    assert bandwidth_from_moments(np.zeros(2), np.zeros(2), 500) == 1.0


def parzen(share: float) -> float:
    return 1 - 6 * share**2 + 6 * share**3 if share < 0.5 else 2 * max(0.0, 1 - share) ** 3


def test_two_moving_sums_are_parzens_kernel() -> None:
    width = 40
    triangle = moving_sum(np.pad(np.ones((width, 1)), ((width - 1, width - 1), (0, 0))), width)[:, 0]
    assert window_power(width) == pytest.approx(triangle @ triangle)
    kernel = np.correlate(triangle, triangle, "full")[len(triangle) - 1 :] / window_power(width)
    for lag in range(2 * width - 1):
        assert kernel[lag] == pytest.approx(parzen(lag / (2.0 * width)), abs=2e-3)


def beside_noise(rng: np.random.Generator, n: int, size: float, length: int) -> np.ndarray:
    """Return white noise of size 1 and a part that stays alike over `length` instants, shape (n, 3)."""
    slow = moving_sum(rng.standard_normal((n + length - 1, 3)), length) / np.sqrt(length)
    return np.asarray(rng.standard_normal((n, 3)) + size * slow)


@pytest.mark.parametrize(("size", "least", "most"), [(0.0, 1.0, 1.02), (0.2, 1.8, 2.3), (0.15, 1.4, 1.9)])
def test_a_small_part_that_lasts_is_seen_beside_much_noise(size: float, least: float, most: float) -> None:
    rng = np.random.default_rng(7)
    n, length = 4000, 80
    deviations = [
        np.sqrt(np.diag(long_run_covariance([beside_noise(rng, n, size, length)])) / n) for _ in range(60)
    ]
    exact = np.sqrt(1.0 + size**2 * length)
    found = float(np.mean(deviations))
    # an autoregression of first order, whose coefficient is near zero, finds 1.0 to 1.1 for all of them
    assert least < found < most
    assert found == pytest.approx(exact, rel=0.1)


def test_a_series_in_parts_gives_the_same_and_so_do_sums_over_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    psi = beside_noise(np.random.default_rng(9), 5001, 0.3, 100)

    def parts() -> Iterator[np.ndarray]:
        yield from (psi[start : start + 333] for start in range(0, len(psi), 333))

    whole = scores_bandwidth([psi])
    assert whole > 100.0
    assert scores_bandwidth([parts]) == pytest.approx(whole, rel=1e-12)
    monkeypatch.setattr(bandwidth, "KEPT_SUMS", len(psi))
    assert whole / 2.0 < scores_bandwidth([parts]) < 2.0 * whole
    # what lasts for as long as the record cannot be distinguished from none
    assert scores_bandwidth([psi, np.zeros((0, 3))]) <= LONGEST_WINDOW * len(psi)


def test_a_short_series_is_computed_once() -> None:
    x, asked = np.random.default_rng(3).standard_normal((900, 2)), []

    def parts() -> Iterator[np.ndarray]:
        asked.append(1)
        return iter(np.split(x, 9))

    for most, times in ((1800, 1), (1799, 2)):
        asked.clear()
        series = bandwidth.KeptOnce(parts, most)
        for _ in range(2):
            np.testing.assert_array_equal(np.concatenate(list(bandwidth.in_parts(series))), x)
        assert len(asked) == times
    # a pass that ends early keeps nothing
    series = bandwidth.KeptOnce(parts, 1800)
    next(iter(series()))
    assert series.whole is None


@pytest.mark.parametrize("shape", [(60, 8), (30, 30)])
def test_sums_of_squares_in_unit_coordinates_are_those_in_principal_directions(
    shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    series = rng.standard_normal(shape) @ np.diag(10.0 ** rng.uniform(-6.0, 6.0, shape[1]))
    other = rng.standard_normal((20, shape[1])) * np.std(series, axis=0)
    principal = bandwidth._unit_directions(series)

    def asked(_: np.ndarray) -> np.ndarray:
        raise AssertionError

    monkeypatch.setattr(bandwidth, "_unit_directions", asked)
    unit = bandwidth._unit_coordinates(series)
    assert unit.shape == principal.shape
    np.testing.assert_allclose(np.sum((series @ unit) ** 2), shape[1], rtol=1e-6)
    np.testing.assert_allclose(np.sum((other @ unit) ** 2), np.sum((other @ principal) ** 2), rtol=1e-6)


@pytest.mark.parametrize("kind", ["nothing", "sum", "nearly a sum"])
def test_unit_coordinates_leave_out_directions_that_are_rounding(kind: str) -> None:
    series = np.random.default_rng(6).standard_normal((50, 4))
    if kind == "nothing":
        series[:, 3] = 0.0
    else:
        series[:, 3] = series[:, 0] + series[:, 1] + (kind != "sum") * 1e-7 * series[:, 2]
    assert bandwidth._unit_coordinates(series).shape == (4, 3)
