"""The solver against certified values: linear regression of the NIST Statistical Reference Datasets."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.nist_data import Problem, exact_solution, problems
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import printed_covariance
from modelgen.runtime.least_squares.orthogonal_solution import least_squares
from modelgen.runtime.numerics.iterative_refinement import refined
from modelgen.runtime.rows.row_block import RowBlock

PROBLEMS = {problem.name: problem for problem in problems()}
DIGITS = {name: 7.0 if name == "Filip" else 9.0 for name in PROBLEMS}


def digits(found: float, certified: float) -> float:
    error = abs(found - certified) / (abs(certified) or 1.0)
    return 15.0 if error == 0.0 else -math.log10(error)


def fit_of(problem: Problem) -> Fit:
    """Return the fit as estimation makes it: one block, weight 1."""
    W, Y = problem.W, problem.Y
    solution = least_squares(W, Y)
    fields = {name: None for name in RowBlock.__dataclass_fields__}
    block = RowBlock(**{**fields, "W": W, "Y": Y, "place": np.arange(len(Y)), "grid": len(Y)})  # type: ignore[arg-type]
    columns = tuple(f"b{i}" for i in range(W.shape[1]))
    return Fit(columns, (), solution, (block,), (1.0,), (Y - W @ solution.x,))


def test_all_eleven_are_there() -> None:
    sizes = {name: np.shape(problem.rows) for name, problem in PROBLEMS.items()}
    assert sizes == {
        "Norris": (36, 2),
        "Pontius": (40, 3),
        "NoInt1": (11, 1),
        "NoInt2": (3, 1),
        "Filip": (82, 11),
        "Longley": (16, 7),
        **{f"Wampler{i}": (21, 6) for i in range(1, 6)},
    }


@pytest.mark.parametrize("name", PROBLEMS)
def test_data_and_certified_values_agree_exactly(name: str) -> None:
    problem = PROBLEMS[name]
    x, variances = exact_solution(problem)
    for found, certified in zip(x, problem.coefficients, strict=True):
        assert abs(found - certified) <= abs(certified) / 10**14
    for variance, certified in zip(variances, problem.deviations, strict=True):
        assert digits(math.sqrt(variance), float(certified)) >= 14.0


@pytest.mark.parametrize("name", PROBLEMS)
def test_certified_digits(name: str) -> None:
    problem = PROBLEMS[name]
    fit = fit_of(problem)
    _, covariance = printed_covariance(fit)
    for found, certified in zip(fit.solution.x, problem.coefficients, strict=True):
        assert digits(found, float(certified)) >= DIGITS[name]
    for found, certified in zip(np.sqrt(np.diag(covariance)), problem.deviations, strict=True):
        assert digits(found, float(certified)) >= DIGITS[name]


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_order_of_the_rows_does_not_matter(name: str) -> None:
    problem = PROBLEMS[name]
    order = np.random.default_rng(8).permutation(len(problem.measured))
    there, back = (least_squares(problem.W[rows], problem.Y[rows]) for rows in (order, slice(None)))
    deviation = np.array([float(value) for value in problem.deviations])
    if deviation.all():
        assert np.all(np.abs(there.x - back.x) < (1e-4 if name == "Filip" else 1e-9) * deviation)


def test_refinement_wins_digits_where_the_residual_is_large() -> None:
    problem = PROBLEMS["Wampler5"]
    W, Y = problem.W, problem.Y
    scale = np.linalg.norm(W, axis=0)
    plain = np.linalg.lstsq(W / scale, Y, rcond=None)[0] / scale
    better = refined([(W, Y)], plain, np.linalg.inv((W / scale).T @ (W / scale)) / np.outer(scale, scale))
    assert np.max(np.abs(plain - 1.0)) > 1e-8
    assert np.max(np.abs(better - 1.0)) < 1e-13
