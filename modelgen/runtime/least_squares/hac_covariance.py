"""Covariances of a fit: the printed one, eq. (11), and one that is right for coloured residuals (HAC).

Filtering and decimation colour the residuals, and their size varies along a record: eq. (11), made for white
ones, then promises too much. The Newey-West estimator takes both as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.least_squares.wls import Fit

FloatArray = npt.NDArray[np.float64]

# Correlations beyond this make the plug-in bandwidth explode; Andrews and Monahan (1992) cut there, too.
LARGEST_CORRELATION = 0.97
# Andrews' bandwidth makes the mean square error of the variance least; intervals that hold what they say ask
# for a wider one (Sun, Phillips and Jin 2008): of simulated records whose noise is known, standard deviations
# came out at 0.94 to 1.12 of the exact ones with twice that bandwidth, at 0.97 to 1.07 with three times it.
WIDER = 3.0


def printed_covariance(fit: Fit, residual_dof: str = "r-c") -> tuple[float, FloatArray]:
    """Return sigma and C = sigma^2 (W^T W)^-1 (Pham 2002, eq. (11)), shape (c, c).

    `residual_dof` says what |Y - W X|^2 is divided by: "r-c" (eq. (11)) or "r-1", the residual's plain
    variance, with which published figures are reproduced.
    """
    residual = fit.weighted_residual
    lost = len(fit.columns) if residual_dof == "r-c" else 1
    variance = float(residual @ residual) / (len(residual) - lost)
    return float(np.sqrt(variance)), variance * fit.solution.inverse


def hac_covariance(fit: Fit) -> FloatArray:
    """Return the heteroskedasticity- and autocorrelation-consistent covariance, shape (c, c).

    As Newey and West (1987), but with Parzen's kernel: differentiated noise has its power at high frequencies
    that their triangle lets through. Three times the bandwidth of Andrews (1991), and what that wants of
    small samples, `fixed_b_factor`. Rows of one instant are taken together; masked instants count as zeros at
    their place, records as independent.
    """
    r = sum(len(residual) for residual in fit.residuals)
    return long_run_covariance(influence(fit)) * r / (r - len(fit.columns) - fit.lost)


def long_run_covariance(series: list[FloatArray]) -> FloatArray:
    """Return the covariance of the sum over all instants and records of series, shape (n, c) each.

    Parzen's kernel is the triangle's with itself: its weighted sum over lags is the sum of squares of
    the series after two moving sums, which is never negative and costs the same for every bandwidth.
    """
    bandwidth = andrews_bandwidth(series)
    width = window_width(bandwidth)
    sums = []
    for psi in series:
        twice = moving_sum(moving_sum(_widened(psi, width), width), width)
        sums.append(squared_sums(twice, width))
    return joined_covariance(sums, bandwidth, sum(len(psi) for psi in series))


@dataclass(frozen=True, eq=False)
class KernelSums:
    """What a record gives: the kernel's sum over lags, shape (c, c), and `fourth`, shape (c,).

    The latter are the sums of fourth powers of the influence after its moving sums.
    """

    total: FloatArray
    fourth: FloatArray


def squared_sums(twice: FloatArray, width: int) -> KernelSums:
    """Return the sums over an influence after its moving sums, shape (n, c)."""
    power, squares = window_power(width), twice**2
    return KernelSums(twice.T @ twice / power, np.einsum("nc,nc->c", squares, squares) / power**2)


def joined_covariance(sums: Sequence[KernelSums], bandwidth: float, n: int) -> FloatArray:
    """Return the covariance, shape (c, c), from the sums of all records, n instants together.

    Each record's share grows by the factor for the instants that it rests on. One factor a record, for all
    columns: their near dependences, which composites live by, stay as they are.
    """
    power = np.diag(np.sum([one.total for one in sums], axis=0))
    alive = power > 0.0
    result = np.zeros((len(power), len(power)))
    for one in sums:
        shares = np.sum(np.diag(one.total)[alive] / power[alive])
        fourth = np.sum(one.fourth[alive] / power[alive] ** 2)
        instants = effective_instants(float(shares), float(fourth), n)
        result += one.total * fixed_b_factor(bandwidth, instants)
    return result


def effective_instants(shares: float, fourth: float, n: int) -> float:
    """Return on how many of n instants the share of a record in the columns' variances rests.

    Parameters
    ----------
    shares : float
        The record's shares in the variances, summed over the columns.
    fourth : float
        Its fourth powers relative to the squares of these variances, summed likewise. Normal noise of even
        size has fourth moments of three squared variances: all n instants count. Where a few stretches say
        most of what is said about a column, its variance is no more certain than these few make it.
    n : int
        Number of instants of all records.
    """
    return min(float(n), 3.0 * shares / fourth) if fourth > 0.0 else float(n)


def window_width(bandwidth: float) -> int:
    """Return over how many instants a moving sum goes, taken twice, for Parzen's kernel of that bandwidth."""
    return max(1, round(0.5 * bandwidth))


def window_power(width: int) -> float:
    """Return the sum of squares of the triangle that two moving sums make: the kernel's weight at lag 0."""
    return width * (2.0 * width**2 + 1.0) / 3.0


def moving_sum(series: FloatArray, width: int) -> FloatArray:
    """Return the sums over `width` neighbours, shape (n - width + 1, c), of a series of shape (n, c)."""
    sums = np.vstack([np.zeros(series.shape[1]), np.cumsum(series, axis=0)])
    return np.asarray(sums[width:] - sums[:-width])


def _widened(psi: FloatArray, width: int) -> FloatArray:
    """Return a series with the zeros around it that two moving sums reach into."""
    zeros = np.zeros((2 * (width - 1), psi.shape[1]))
    return np.vstack([zeros, psi, zeros])


def fixed_b_factor(bandwidth: float, n: float) -> float:
    """Return by how much a variance grows so that normal intervals of 95 % hold with this bandwidth.

    Critical values by b = bandwidth / n, n instants, after Kiefer and Vogelsang (2005), simulated for
    Parzen's kernel.
    """
    b = min(bandwidth / n, 1.0)
    return float(((1.96 + 1.8952 * b + 2.1790 * b**2 - 0.3610 * b**3) / 1.96) ** 2)


def influence(fit: Fit) -> list[FloatArray]:
    """Return for every record what each instant contributes to X's error, shape (grid, c) each."""
    if fit.series:
        return list(fit.series)
    series: dict[int, FloatArray] = {}
    parts = zip(fit.blocks, fit.weights, fit.residuals, fit.regressors, strict=True)
    for block, weight, residual, regressor in parts:
        psi = series.setdefault(block.record, np.zeros((block.grid, len(fit.columns))))
        psi[block.place] += (weight**2 * residual)[:, None] * (regressor @ fit.solution.inverse)
    return list(series.values())


def andrews_bandwidth(series: list[FloatArray]) -> float:
    """Return three times the bandwidth of Andrews (1991) for Parzen's kernel, eqs. (6.2), (6.4), at least 1.

    It comes from first-order autoregressions of the columns, which weigh alike.
    """
    power = np.sum([np.sum(psi**2, axis=0) for psi in series], axis=0)
    product = np.sum([np.sum(psi[1:] * psi[:-1], axis=0) for psi in series], axis=0)
    return bandwidth_from_moments(power, product, max(len(psi) for psi in series))


def bandwidth_from_moments(power: FloatArray, product: FloatArray, n: int) -> float:
    """Return the same from sums of squares and of products of neighbours, and the longest record's length."""
    alive = power > 0.0
    if not np.any(alive):
        return 1.0
    rho = np.clip(product[alive] / power[alive], -LARGEST_CORRELATION, LARGEST_CORRELATION)
    # innovations' variance relative to the series' own, so that every column weighs alike
    innovation = 1.0 - rho**2
    numerator = np.sum(4.0 * rho**2 * innovation**2 / (1.0 - rho) ** 8)
    denominator = np.sum(innovation**2 / (1.0 - rho) ** 4)
    return max(1.0, WIDER * float(2.6614 * (numerator / denominator * n) ** (1.0 / 5.0)))
