"""Certified digits on the linear regressions of the NIST StRD: modelgen compared with other libraries.

A figure is the smallest -log10 of a relative error over all coefficients (absolute where NIST certifies 0),
at most 15; the second figure is that of the standard deviations. Two libraries give no standard deviations:
theirs are residual and inverse normal matrix, as their users compute them.

    python benchmarks/nist.py
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
from nist_data import FloatArray, Problem, problems

from modelgen.runtime.least_squares.orthogonal_solution import least_squares

Solver = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
MOST_DIGITS = 15.0


def by_modelgen(W: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    solution = least_squares(W, Y)
    residual = Y - W @ solution.x
    variance = residual @ residual / (len(Y) - W.shape[1])
    return solution.x, np.sqrt(variance * np.diag(solution.inverse))


def by_scipy(W: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    from scipy.linalg import lstsq

    return _with_deviations(W, Y, lstsq(W, Y)[0])


def by_statsmodels(W: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    from statsmodels.api import OLS

    fit = OLS(Y, W).fit()
    return fit.params, fit.bse


def by_statsmodels_qr(W: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    from statsmodels.api import OLS

    fit = OLS(Y, W).fit(method="qr")
    return fit.params, fit.bse


def by_sklearn(W: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    from sklearn.linear_model import LinearRegression

    return _with_deviations(W, Y, LinearRegression(fit_intercept=False).fit(W, Y).coef_)


def _with_deviations(W: FloatArray, Y: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    residual = Y - W @ x
    variance = residual @ residual / (len(Y) - W.shape[1])
    return x, np.sqrt(np.abs(variance * np.diag(np.linalg.pinv(W.T @ W))))


SOLVERS: dict[str, Solver] = {
    "modelgen": by_modelgen,
    "scipy lstsq": by_scipy,
    "statsmodels": by_statsmodels,
    "statsmodels qr": by_statsmodels_qr,
    "scikit-learn": by_sklearn,
}


def digits(found: FloatArray, certified: FloatArray) -> float:
    """Return the smallest number of certified digits."""
    scale = np.where(certified == 0.0, 1.0, np.abs(certified))
    worst = float(np.max(np.abs(found - certified) / scale))
    return MOST_DIGITS if worst == 0.0 else max(0.0, min(MOST_DIGITS, -math.log10(worst)))


def certified_digits(problem: Problem, solve: Solver) -> tuple[float, float]:
    """Return the certified digits of the coefficients and of their standard deviations."""
    x, deviations = solve(problem.W, problem.Y)
    return (
        digits(x, np.array(list(map(float, problem.coefficients)))),
        digits(deviations, np.array(list(map(float, problem.deviations)))),
    )


def main() -> None:
    warnings.simplefilter("ignore")
    print("certified digits: coefficients / standard deviations")
    print(f"{'':10}" + "".join(f"{name:>16}" for name in SOLVERS))
    for problem in problems():
        cells = [certified_digits(problem, solve) for solve in SOLVERS.values()]
        print(f"{problem.name:10}" + "".join(f"{f'{x:.1f} / {s:.1f}':>16}" for x, s in cells))


if __name__ == "__main__":
    main()
