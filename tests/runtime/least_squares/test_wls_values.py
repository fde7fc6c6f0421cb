"""The weights, scales, thresholds and messages of weighted least squares, number by number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.orthogonal_solution import (
    TriangleInverse,
    _rounding,
    inverse_of,
    least_squares,
)
from modelgen.runtime.least_squares.thresholds import FEW_ROWS, SMALLEST_RESIDUAL
from modelgen.runtime.least_squares.wls import fit_matched, fit_paper, refit
from modelgen.runtime.numerics.iterative_refinement import Parts
from modelgen.runtime.numerics.regressor import plain_regressors
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.least_squares.row_blocks import block

FloatArray = npt.NDArray[np.float64]


def two_rows(noise: tuple[float, float], n: int = 400) -> tuple[RowBlock, RowBlock]:
    """Two rows that hold a force, with white noise of these standard deviations; x = (1, -2)."""
    random = np.random.default_rng(11)
    first, second = random.standard_normal((2, n, 2))
    x = np.array([1.0, -2.0])
    return (
        block(first, first @ x + noise[0] * random.standard_normal(n), scale=3.0),
        block(second, second @ x + noise[1] * random.standard_normal(n), row=1, scale=0.5),
    )


def with_zero_column(one: RowBlock) -> RowBlock:
    return replace(one, W=np.insert(one.W, 1, 0.0, axis=1))


def stacked(blocks: tuple[RowBlock, ...], weights: tuple[float, ...]) -> FloatArray:
    """Solve the weighted rows with NumPy's own solver."""
    W = np.concatenate([weight * one.W for weight, one in zip(weights, blocks, strict=True)])
    Y = np.concatenate([weight * one.Y for weight, one in zip(weights, blocks, strict=True)])
    return np.linalg.lstsq(W, Y, rcond=None)[0]


def rms(blocks: tuple[RowBlock, ...], x: FloatArray) -> list[float]:
    return [float(np.sqrt(np.mean((one.Y - one.W @ x) ** 2))) for one in blocks]


# Weights ------------------------------------------------------------------------------------------


def test_rows_weigh_the_inverse_of_their_residual() -> None:
    blocks = two_rows((0.02, 0.5))
    weights = (1.0 / 3.0, 1.0 / 0.5)
    for _ in range(3):
        weights = tuple(1.0 / one for one in rms(blocks, stacked(blocks, weights)))
    fit = fit_matched(Observation(("a", "b"), blocks))
    np.testing.assert_allclose(fit.weights, weights, rtol=1e-9)
    np.testing.assert_allclose(fit.solution.x, stacked(blocks, weights), rtol=1e-9)
    np.testing.assert_allclose(fit.weights, [1.0 / 0.02, 1.0 / 0.5], rtol=0.1)


def test_the_paper_weighs_once_by_the_residual_of_ordinary_least_squares() -> None:
    blocks = two_rows((0.02, 0.5))
    weights = tuple(1.0 / one for one in rms(blocks, stacked(blocks, (1.0, 1.0))))
    fit = fit_paper(Observation(("a", "b"), blocks))
    np.testing.assert_allclose(fit.weights, weights, rtol=1e-9)
    np.testing.assert_allclose(fit.solution.x, stacked(blocks, weights), rtol=1e-9)


def test_a_load_row_weighs_a_fifth_of_what_its_first_residual_gives() -> None:
    random = np.random.default_rng(12)
    n = 500
    a, d = random.standard_normal((2, n))
    zero = np.zeros(n)
    motor = block(np.column_stack([a, zero, d]), a + 2.0 * d + 0.3 * random.standard_normal(n), scale=4.0)
    noisy = 4.0 * d + 0.2 * random.standard_normal(n)
    load = block(np.column_stack([zero, noisy, -d]), zero, row=1, scale=0.25, has_force=False)
    blocks = (motor, load)
    # the start is scaled by the forces: 1/4 and 4, not 4 and 1/4
    first = rms(blocks, stacked(blocks, (1.0 / 4.0, 1.0 / 0.25)))[1]
    fit = fit_matched(Observation(("J", "J_c", "K"), blocks))
    assert fit.weights[1] == pytest.approx(1.0 / (first / 0.2), rel=1e-6)
    assert fit.weights[0] == pytest.approx(1.0 / rms(blocks, fit.solution.x)[0], rel=1e-3)


def test_rows_without_noise_weigh_by_their_forces_over_all_records() -> None:
    random = np.random.default_rng(13)
    x = np.array([1.0, -2.0])
    rows = random.standard_normal((4, 50, 2))
    blocks = (
        block(rows[0], rows[0] @ x, scale=3.0, grid=100),
        block(rows[1], rows[1] @ x, record=1, scale=4.0, grid=300),
        block(rows[2], rows[2] @ x, row=1, scale=0.0),
        block(rows[3], rows[3] @ x, row=2, scale=20.0),
    )
    weights = fit_matched(Observation(("a", "b"), blocks)).weights
    over_both = np.sqrt((100 * 9.0 + 300 * 16.0) / 400)
    scales = np.array([over_both, over_both, 1.0, 20.0])  # a row without any force scale counts as it is
    np.testing.assert_allclose(weights, 1.0 / (SMALLEST_RESIDUAL * scales), rtol=1e-12)


def test_a_load_row_without_noise_is_bounded_by_its_forces_too() -> None:
    random = np.random.default_rng(14)
    a, d = random.standard_normal((2, 200))
    zero = np.zeros(200)
    motor = block(np.column_stack([a, zero, d]), a + 2.0 * d, scale=2.0)
    load = block(np.column_stack([zero, 4.0 * d, -d]), zero, row=1, scale=1e3, has_force=False)
    fit = fit_matched(Observation(("J", "J_c", "K"), (motor, load)))
    assert fit.weights[1] == pytest.approx(1.0 / (SMALLEST_RESIDUAL * 1e3))
    np.testing.assert_allclose(fit.solution.x, [1.0, 0.5, 2.0], rtol=1e-9)
    assert fit.notes == ()


# Columns ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solve", [fit_matched, fit_paper])
@pytest.mark.parametrize("count", [1, 2])
def test_every_fit_names_its_columns(solve: object, count: int) -> None:
    blocks = tuple(map(with_zero_column, two_rows((0.1, 0.2))[:count]))
    fit = solve(Observation(("a", "never", "b"), blocks))  # type: ignore[operator]
    assert (fit.columns, fit.absent) == (("a", "b"), ("never",))
    assert (fit.notes, fit.projected, fit.delays) == ((), None, ())
    assert [one.W.shape for one in fit.blocks] == [(400, 2)] * count
    assert [one.dense().tolist() for one in fit.regressors] == [one.W.tolist() for one in fit.blocks]


def test_refit_keeps_what_is_absent_and_the_instruments() -> None:
    blocks = tuple(map(with_zero_column, two_rows((0.1, 0.2))))
    fit = fit_matched(Observation(("a", "never", "b"), blocks))
    assert refit(fit, ["b"]).projected is None
    # instruments half as large: x twice as large
    halved = plain_regressors(tuple(0.5 * one.W for one in fit.blocks))
    reduced = refit(replace(fit, projected=halved), ["b"])
    assert (reduced.columns, reduced.absent, reduced.weights) == (("b",), ("never",), fit.weights)
    kept = [one[:, [1]].tolist() for one in halved.samples]
    assert [one.dense().tolist() for one in reduced.projected] == kept
    assert reduced.solution.x[0] == pytest.approx(2.0 * refit(fit, ["b"]).solution.x[0], rel=1e-9)
    np.testing.assert_array_equal(
        reduced.residuals[0], fit.blocks[0].Y - fit.blocks[0].W[:, [1]] @ reduced.solution.x
    )


def test_residuals_and_measurement_are_stacked_with_their_weights() -> None:
    fit = fit_matched(Observation(("a", "b"), two_rows((0.02, 0.5))))
    first, second = fit.weights
    np.testing.assert_array_equal(
        fit.weighted_residual, np.concatenate([first * fit.residuals[0], second * fit.residuals[1]])
    )
    np.testing.assert_array_equal(
        fit.weighted_measurement, np.concatenate([first * fit.blocks[0].Y, second * fit.blocks[1].Y])
    )
    assert fit.relative_error == pytest.approx(
        np.linalg.norm(fit.weighted_residual) / np.linalg.norm(fit.weighted_measurement)
    )
    silent = replace(fit, blocks=tuple(replace(one, Y=0.0 * one.Y) for one in fit.blocks))
    assert silent.relative_error == np.inf


@pytest.mark.slow
@given(st.lists(st.tuples(st.booleans(), st.floats(0.01, 100.0)), min_size=1, max_size=4), st.integers(0, 99))
def test_the_relative_error_lies_between_those_of_the_rows(rows: list[tuple[bool, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.array([2.0, -1.0])
    blocks = []
    for forced, error in [(True, 1.0), *rows]:
        W = rng.standard_normal((50, 2))
        Y = W @ x + error * rng.standard_normal(50)
        blocks.append(replace(block(W, Y if forced else Y - W @ x), has_force=forced))
    fit = fit_matched(Observation(("a", "b"), tuple(blocks)))
    own = []
    for one, residual in zip(fit.blocks, fit.residuals, strict=True):
        terms = np.linalg.norm((one.W - one.W.mean(axis=0)) * fit.solution.x, axis=0)
        size = np.linalg.norm(one.Y) if one.has_force else terms.max()
        own.append(np.linalg.norm(residual) / size)
        assert one.size(fit.solution.x) == pytest.approx(size)
    assert min(own) * (1.0 - 1e-9) <= fit.relative_error <= max(own) * (1.0 + 1e-9)


def test_terms_norm_is_that_of_the_largest_term() -> None:
    W = np.array([[1.0, 10.0], [-1.0, 10.5], [1.0, 9.5], [-1.0, 10.0]])
    one = block(W, np.ones(4))
    assert one.terms_norm(np.array([-3.0, 2.0])) == pytest.approx(3.0 * 2.0)
    assert one.terms_norm(np.array([0.1, -100.0])) == pytest.approx(100.0 * np.sqrt(0.5))


# Rank and rounding --------------------------------------------------------------------------------


def with_singular_values(*s: float) -> FloatArray:
    """Return four columns of unit length with these singular values (their squares must add up to 4)."""
    hadamard = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2.0
    U = np.linalg.qr(np.random.default_rng(15).standard_normal((60, 4)))[0]
    return np.asarray(U * np.array(s) @ hadamard)


def test_what_is_below_a_share_of_the_largest_singular_value_cannot_be_told_apart() -> None:
    almost_two = float(np.sqrt(4.0 - 2e-4))
    lost = least_squares(with_singular_values(almost_two, 1e-2, 1e-2, 1e-10), np.ones(60))
    assert lost.undetermined.tolist() == [True] * 4  # 1e-10 of two is not more than 1e-10 of two
    kept = least_squares(with_singular_values(almost_two, 1e-2, 1e-2, 4e-10), np.ones(60))
    assert not kept.undetermined.any()


def test_condition_numbers_are_those_of_scaled_and_raw_columns() -> None:
    W = np.random.default_rng(16).standard_normal((80, 3)) * [1.0, 50.0, 2.0]
    W[:, 2] += 0.9 * W[:, 0]
    solution = least_squares(W, np.ones(80))
    scaled = W / np.linalg.norm(W, axis=0)
    assert solution.condition_number == pytest.approx(np.linalg.cond(scaled), rel=1e-9)
    assert solution.condition_number_raw == pytest.approx(np.linalg.cond(W), rel=1e-9)


def test_columns_that_are_exactly_equal_have_no_condition_number() -> None:
    W = np.zeros((5, 2))
    W[0] = 2.0
    solution = least_squares(W, np.arange(5.0) + 4.0)
    assert solution.condition_number == np.inf
    assert solution.undetermined.all()
    np.testing.assert_allclose(solution.x, [1.0, 1.0])  # the shortest of all solutions


def test_inverses_of_triangles_are_those_of_singular_values(monkeypatch: pytest.MonkeyPatch) -> None:
    R = np.linalg.qr(np.random.default_rng(0).standard_normal((60, 40)), mode="r")
    R = R / np.linalg.norm(R, axis=0)
    quick = inverse_of(R, 1e-10)
    monkeypatch.setattr("modelgen.runtime.least_squares.orthogonal_solution.REFINABLE", 1.0)
    exact = inverse_of(R, 1e-10)
    np.testing.assert_allclose(quick.inverse, exact.inverse, rtol=0.0, atol=1e-12)
    assert quick.largest != exact.largest
    assert 0.8 * exact.largest < quick.largest <= exact.largest
    assert exact.smallest <= quick.smallest < 1.25 * exact.smallest
    assert quick.null.shape == exact.null.shape == (0, 40)


def test_rounding_follows_wedin() -> None:
    eps = float(np.finfo(float).eps)
    s = TriangleInverse(np.diag([0.25, 1.0, 2.0]), np.empty((0, 3)), 4.0, 0.5)
    for residual, size, expected in (
        (0.0, 2.0, 8.0),
        (3.0, 2.0, 8.0 * (1.0 + 8.0 * 3.0 / 8.0)),
        (0.0, 0.0, 8.0),
    ):
        assert _rounding(s, size, residual) == pytest.approx(eps * expected, rel=1e-12, abs=0.0)
    assert _rounding(s, 0.5, 3.0) == pytest.approx(eps * 8.0 * (1.0 + 8.0 * 3.0 / 2.0), rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("rows", "residual", "narrow", "expected"),
    [
        (FEW_ROWS, 0.0, 1.0, True),  # costs next to nothing
        (FEW_ROWS + 1, 0.0, 1.0, False),  # not needed
        (FEW_ROWS + 1, 1e3, 1e-3, True),  # a large residual through a narrow direction
        (FEW_ROWS + 1, 1e3, 1e-8, False),  # beyond what refinement can do
    ],
)
def test_solutions_are_refined_where_that_helps(
    monkeypatch: pytest.MonkeyPatch, rows: int, residual: float, narrow: float, expected: bool
) -> None:
    called: list[int] = []

    def refined(parts: Parts, x: FloatArray, inverse: FloatArray) -> FloatArray:
        called.append(len(parts))
        return x

    monkeypatch.setattr("modelgen.runtime.least_squares.orthogonal_solution.refined", refined)
    random = np.random.default_rng(17)
    W = random.standard_normal((rows, 2))
    W[:, 1] = W[:, 0] + narrow * W[:, 1]
    least_squares(W, W @ np.array([1.0, 2.0]) + residual * random.standard_normal(rows))
    assert bool(called) == expected


# Messages -----------------------------------------------------------------------------------------


def refusal(*blocks: RowBlock) -> str:
    with pytest.raises(IdentifiabilityError) as caught:
        fit_matched(Observation(("a", "b"), blocks))
    return str(caught.value)


def test_columns_of_zeros_are_all_named() -> None:
    assert refusal(block(np.zeros((9, 2)), np.ones(9))) == (
        "a: its column is zero in every sample used; move the body, or mask less\n"
        "b: its column is zero in every sample used; move the body, or mask less"
    )


def test_no_samples_at_all_are_one_mistake() -> None:
    assert refusal(block(np.zeros((0, 2)), np.zeros(0))) == (
        "records: no sample is left: rest or a change of direction is within the filters' reach of every "
        "one; move for longer without reversing, or give a higher cut-off"
    )


def test_too_few_samples_and_no_force_are_explained() -> None:
    W = np.random.default_rng(18).standard_normal((9, 2))
    assert refusal(block(W[:2], np.ones(2))) == (
        "records: 2 samples are left for 2 columns; give longer records, with more motion between reversals"
    )
    assert refusal(block(W, np.zeros(9), has_force=False)) == (
        "rows: none that holds a measured force has samples left, so nothing fixes the scale; "
        "measure a force, and move without reversing for longer"
    )
    fit: Fit = fit_matched(Observation(("a", "b"), (block(W[:3], np.ones(3)),)))
    assert len(fit.weighted_residual) == 3
