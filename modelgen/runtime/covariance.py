"""Covariances of a fit: the printed one, eq. (11), and one that is right for coloured residuals (HAC).

Filtering and decimation colour the residuals, and their size varies along a record: eq. (11), made for white
ones, then promises too much. The Newey-West estimator takes both as they are.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modelgen.runtime.wls import Fit

FloatArray = npt.NDArray[np.float64]

# Correlations beyond this make the plug-in bandwidth explode; Andrews and Monahan (1992) cut there, too.
LARGEST_CORRELATION = 0.97
# Andrews' bandwidth makes the mean square error of the variance least; intervals that hold what they say ask
# for a wider one (Sun, Phillips and Jin 2008), and differentiated noise, negatively correlated, most of all.
WIDER = 2.5


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

    Newey and West (1987): Bartlett kernel; 2.5 times the bandwidth of Andrews (1991), and what that wants of
    small samples, `fixed_b_factor`. Rows of one instant are taken together; masked instants count as zeros at
    their place, records as independent.
    """
    r = sum(len(residual) for residual in fit.residuals)
    return long_run_covariance(influence(fit)) * r / (r - len(fit.columns))


def long_run_covariance(series: list[FloatArray]) -> FloatArray:
    """Return the covariance of the sum over all instants and records of series, shape (n, c) each."""
    bandwidth = andrews_bandwidth(series)
    c = series[0].shape[1]
    total = np.zeros((c, c))
    for psi in series:
        total += psi.T @ psi
        for lag in range(1, min(int(np.ceil(bandwidth)), len(psi))):
            product = psi[lag:].T @ psi[:-lag]
            total += (1.0 - lag / bandwidth) * (product + product.T)
    return total * fixed_b_factor(bandwidth, sum(len(psi) for psi in series))


def fixed_b_factor(bandwidth: float, n: int) -> float:
    """Return by how much a variance grows so that normal intervals of 95 % hold with this bandwidth.

    Kiefer and Vogelsang (2005), table 1, Bartlett kernel: critical values by b = bandwidth / n.
    """
    b = min(bandwidth / n, 1.0)
    return float(((1.96 + 2.9694 * b + 0.4160 * b**2 - 0.5324 * b**3) / 1.96) ** 2)


def influence(fit: Fit) -> list[FloatArray]:
    """Return for every record what each instant contributes to X's error, shape (grid, c) each."""
    series: dict[int, FloatArray] = {}
    parts = zip(fit.blocks, fit.weights, fit.residuals, fit.regressors, strict=True)
    for block, weight, residual, regressor in parts:
        psi = series.setdefault(block.record, np.zeros((block.grid, len(fit.columns))))
        psi[block.place] += (weight**2 * residual)[:, None] * (regressor @ fit.solution.inverse)
    return list(series.values())


def andrews_bandwidth(series: list[FloatArray]) -> float:
    """Return 2.5 times the Bartlett bandwidth of Andrews (1991), eqs. (6.2), (6.4), at least 1.

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
    numerator = np.sum(4.0 * rho**2 * innovation**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2))
    denominator = np.sum(innovation**2 / (1.0 - rho) ** 4)
    return max(1.0, WIDER * float(1.1447 * (numerator / denominator * n) ** (1.0 / 3.0)))
