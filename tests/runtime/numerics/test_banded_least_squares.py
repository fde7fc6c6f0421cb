"""The banded solution against dense ones, and the accuracy of triangles."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from modelgen.runtime.least_squares.wls import least_squares
from modelgen.runtime.numerics.banded_least_squares import solve_banded
from modelgen.runtime.numerics.qr_triangle import triangle_of
from modelgen.runtime.numerics.qr_update import take_in
from modelgen.runtime.rows.row_factor import RowFactor, empty_factor


def problem(
    touched: list[list[int]], seed: int = 0, rows: int = 12
) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Random rows that touch some columns: their triangles, and all of W and Y."""
    rng = np.random.default_rng(seed)
    c = 1 + max(column for columns in touched for column in columns)
    triangles, Ws, Ys = [], [], []
    for columns in touched:
        W, Y = rng.standard_normal((rows, len(columns))), rng.standard_normal(rows)
        wide = np.zeros((rows, c))
        wide[:, columns] = W
        triangles.append(triangle_of(np.column_stack([W, Y])))
        Ws.append(wide)
        Ys.append(Y)
    return triangles, np.vstack(Ws), np.concatenate(Ys)


CHAIN = [[3 * i + k for k in range(-2, 4) if 0 <= 3 * i + k < 58] for i in range(19)]
LOOP = [[2 * i, 2 * i + 1, (2 * i + 2) % 40, (2 * i + 3) % 40] for i in range(20)]
STAR = [[0, 1, 2 * i, 2 * i + 1] for i in range(1, 15)]


@pytest.mark.parametrize(("touched", "widest"), [(CHAIN, 6), (LOOP, 6), (STAR, 4)])
def test_it_is_the_dense_solution(touched: list[list[int]], widest: int) -> None:
    triangles, W, Y = problem(touched)
    found = solve_banded(triangles, touched, W.shape[1])
    x = np.linalg.lstsq(W, Y)[0]
    np.testing.assert_allclose(found.x, x, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.variance, np.diag(np.linalg.inv(W.T @ W)), rtol=1e-10)
    assert found.residual == pytest.approx(np.linalg.norm(Y - W @ x), rel=1e-12)
    assert found.full_rank
    assert found.widest <= widest


def test_columns_that_cannot_be_told_apart_are_noticed() -> None:
    triangles, W, _ = problem(CHAIN)
    for triangle, columns in zip(triangles, CHAIN, strict=True):
        if 20 in columns and 21 in columns:
            triangle[:, columns.index(21)] = 2.0 * triangle[:, columns.index(20)]
        elif 20 in columns or 21 in columns:
            triangle[:, [i for i, column in enumerate(columns) if column in (20, 21)]] = 0.0
    assert not solve_banded(triangles, CHAIN, W.shape[1]).full_rank


def test_the_scale_of_a_column_does_not_matter() -> None:
    triangles, W, Y = problem(CHAIN)
    scale = np.logspace(-9, 9, W.shape[1])
    scaled = [
        triangle * np.append(scale[columns], 1.0) for triangle, columns in zip(triangles, CHAIN, strict=True)
    ]
    found = solve_banded(scaled, CHAIN, W.shape[1])
    np.testing.assert_allclose(found.x * scale, np.linalg.lstsq(W, Y)[0], rtol=1e-10, atol=1e-12)


def exact_solution(W: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Least squares in fractions: no rounding at all."""
    rows = [[Fraction(value) for value in row] for row in W.tolist()]
    right = [Fraction(value) for value in Y.tolist()]
    c = W.shape[1]
    A = [[sum(row[i] * row[j] for row in rows) for j in range(c)] for i in range(c)]
    b = [sum(row[i] * y for row, y in zip(rows, right, strict=True)) for i in range(c)]
    for i in range(c):
        for k in range(i + 1, c):
            share = A[k][i] / A[i][i]
            A[k] = [p - share * q for p, q in zip(A[k], A[i], strict=True)]
            b[k] -= share * b[i]
    x = [Fraction(0)] * c
    for i in reversed(range(c)):
        x[i] = (b[i] - sum(A[i][j] * x[j] for j in range(i + 1, c))) / A[i][i]
    return np.array([float(value) for value in x])


def test_accuracy_at_a_condition_number_of_ten_million() -> None:
    rng = np.random.default_rng(3)
    U, V = (np.linalg.qr(rng.standard_normal((n, 6)))[0] for n in (300, 6))
    W = U @ np.diag(np.logspace(0.0, -7.6, 6)) @ V.T
    W /= np.linalg.norm(W, axis=0)
    assert 3e6 < np.linalg.cond(W) < 3e7
    W *= np.logspace(-5.0, 4.0, 6)
    Y = W @ (1.0 / np.logspace(-5.0, 4.0, 6)) + 1e-9 * rng.standard_normal(300)
    exact = exact_solution(W, Y)
    factor = factor_of(W, Y, 77)
    triangle = factor.triangle
    dense = least_squares(triangle[:, :-1], triangle[:, -1]).x
    banded = solve_banded([triangle], [list(range(6))], 6).x
    for found in (dense, banded):
        np.testing.assert_allclose(found, exact, rtol=1e-8)
    # the normal equations on scaled columns do not do
    scaled = W / np.linalg.norm(W, axis=0)
    normal = np.linalg.solve(scaled.T @ scaled, scaled.T @ Y) / np.linalg.norm(W, axis=0)
    assert np.max(np.abs(normal / exact - 1.0)) > 1e-6


def factor_of(W: np.ndarray, Y: np.ndarray, at_a_time: int) -> RowFactor:
    lines = np.vstack([np.ones(len(Y)), W.T, Y])
    factor = empty_factor(0, tuple(range(W.shape[1])))
    for first in range(0, len(Y), at_a_time):
        factor = factor.with_rows(lines[:, first : first + at_a_time])
    return factor


@pytest.mark.parametrize("at_a_time", [3, 100, 1500, 5000])
def test_a_triangle_answers_for_its_rows_however_they_came(at_a_time: int) -> None:
    rng = np.random.default_rng(0)
    W, Y = rng.standard_normal((5000, 3)) + 5.0, rng.standard_normal(5000)
    factor = factor_of(W, Y, at_a_time)
    x = np.array([0.3, -1.0, 2.0])
    residual = Y - W @ x
    assert factor.samples == 5000
    assert factor.residual_rms(x) == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-12)
    varies = np.max(np.linalg.norm(W - W.mean(axis=0), axis=0) * np.abs(x))
    assert factor.terms_norm(x) == pytest.approx(varies, rel=1e-12)
    assert factor.force_norm == pytest.approx(np.linalg.norm(Y), rel=1e-12)
    np.testing.assert_allclose(
        factor.triangle.T @ factor.triangle, np.column_stack([W, Y]).T @ np.column_stack([W, Y])
    )


def test_triangles_of_two_stretches_are_joined() -> None:
    rng = np.random.default_rng(0)
    W, Y = rng.standard_normal((400, 3)), rng.standard_normal(400)
    whole = factor_of(W, Y, 400)
    first = replace(factor_of(W[:150], Y[:150], 150), masked=7)
    joined = first.joined(factor_of(W[150:], Y[150:], 250))
    assert (joined.samples, joined.masked) == (400, 7)
    np.testing.assert_allclose(np.abs(joined.R), np.abs(whole.R), rtol=1e-11, atol=1e-13)
    assert factor_of(W[:1], Y[:1], 1).R.shape == (5, 5)


def test_reflections_give_the_triangle_of_the_qr() -> None:
    rng = np.random.default_rng(3)
    lines = rng.standard_normal((5, 700)) * np.logspace(0, 6, 5)[:, None]
    lines[3] = 0.0
    R = triangle_of(rng.standard_normal((20, 5)))
    expected = triangle_of(np.vstack([R, lines.T]))
    take_in(R, lines)
    np.testing.assert_allclose(np.abs(R), np.abs(expected), rtol=1e-10, atol=1e-12)
