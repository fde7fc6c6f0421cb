from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.least_squares.orthogonal_solution import least_squares
from modelgen.runtime.least_squares.wls import fit_matched, fit_paper, refit
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.least_squares.row_blocks import block as row_block


def block(W: np.ndarray, Y: np.ndarray, row: int = 0, record: int = 0, scale: float = 1.0) -> RowBlock:
    """A block whose row holds a force where its left-hand side is not zero."""
    return row_block(W, Y, row, record, scale, has_force=bool(np.any(Y)))


def test_least_squares_agrees_with_the_textbook() -> None:
    rng = np.random.default_rng(0)
    W, Y = rng.standard_normal((200, 3)), rng.standard_normal(200)
    solution = least_squares(W, Y)
    np.testing.assert_allclose(solution.x, np.linalg.lstsq(W, Y, rcond=None)[0], rtol=1e-10)
    np.testing.assert_allclose(solution.inverse, np.linalg.inv(W.T @ W), rtol=1e-10)
    assert solution.condition_number_raw == pytest.approx(np.linalg.cond(W))
    assert not solution.undetermined.any()


def test_columns_of_very_different_size_lose_no_digits() -> None:
    rng = np.random.default_rng(1)
    W = rng.standard_normal((300, 3)) * np.array([1.0, 1e9, 1e-9])
    x = np.array([2.0, 3e-9, -4e9])
    solution = least_squares(W, W @ x)
    np.testing.assert_allclose(solution.x, x, rtol=1e-12)
    assert solution.condition_number < 2.0
    assert solution.condition_number_raw > 1e17


def test_columns_that_cannot_be_told_apart_are_marked_and_the_rest_is_right() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 100))
    solution = least_squares(np.column_stack([a, b, 2.0 * a]), 3.0 * a + 5.0 * b)
    assert solution.undetermined.tolist() == [True, False, True]
    assert solution.x[1] == pytest.approx(5.0)
    assert solution.x[0] + 2.0 * solution.x[2] == pytest.approx(3.0)


def test_one_block_is_ordinary_least_squares() -> None:
    rng = np.random.default_rng(3)
    W, Y = rng.standard_normal((50, 2)), rng.standard_normal(50)
    observation = Observation(("a", "b"), (block(W, Y),))
    for fit in (fit_matched(observation), fit_paper(observation)):
        assert fit.weights == (1.0,)
        np.testing.assert_allclose(fit.solution.x, np.linalg.lstsq(W, Y, rcond=None)[0])
        assert fit.relative_error == pytest.approx(np.linalg.norm(Y - W @ fit.solution.x) / np.linalg.norm(Y))


def test_a_noisy_block_counts_for_little() -> None:
    rng = np.random.default_rng(4)
    x = np.array([1.0, -2.0])
    clean, noisy = rng.standard_normal((2, 400, 2))
    blocks = (
        block(clean, clean @ x + 1e-3 * rng.standard_normal(400)),
        block(noisy, noisy @ x + rng.standard_normal(400), row=1),
    )
    matched = fit_matched(Observation(("a", "b"), blocks))
    np.testing.assert_allclose(matched.solution.x, x, atol=2e-4)
    assert matched.weights[0] / matched.weights[1] == pytest.approx(1000.0, rel=0.2)
    # the paper weights once, by residuals of a fit that the noise has moved
    paper = fit_paper(Observation(("a", "b"), blocks))
    np.testing.assert_allclose(paper.solution.x, x, atol=5e-3)
    assert 5.0 < paper.weights[0] / paper.weights[1] < 100.0


def link_rows(noise: float, force_noise: float) -> tuple[np.ndarray, Observation]:
    """A motor row, y = J a + K d, and a load row, 0 = J a_c - K d, whose columns are noisy."""
    rng = np.random.default_rng(5)
    x = np.array([1.0, 0.5, 2.0])
    n = 2000
    a, d = rng.standard_normal((2, n))
    a_c = x[2] / x[1] * d
    Y = x[0] * a + x[2] * d + force_noise * rng.standard_normal(n)
    a_c, d = a_c + noise * rng.standard_normal(n), d + noise * rng.standard_normal(n)
    zero = np.zeros(n)
    motor = block(np.column_stack([a, zero, d]), Y, 0, scale=2.0)
    load = block(np.column_stack([zero, a_c, -d]), zero, 1, scale=2.0)
    return x, Observation(("J", "J_c", "K"), (motor, load))


def test_a_load_row_does_not_run_away_to_the_null_solution() -> None:
    x, observation = link_rows(0.1, 2.0)
    np.testing.assert_allclose(fit_matched(observation).solution.x, x, rtol=0.1)
    # weighted as its residual asks, it does
    assert abs(fit_matched(observation, load_row_share=1e6).solution.x[2]) < 0.05 * x[2]


def test_a_load_row_on_its_way_to_zero_is_noted() -> None:
    noisy, clean = (fit_matched(link_rows(0.1, force_noise)[1]) for force_noise in (2.0, 0.1))
    assert [note.split(" holds")[0] for note in noisy.notes] == ["record 0, row row 1"]
    assert clean.notes == ()


def test_rows_without_any_force_have_no_scale() -> None:
    W = np.random.default_rng(6).standard_normal((30, 2))
    with pytest.raises(IdentifiabilityError, match="nothing fixes the scale"):
        fit_matched(Observation(("a", "b"), (block(W, np.zeros(30)),)))


def test_too_few_samples_answer_nothing() -> None:
    W = np.random.default_rng(7).standard_normal((2, 2))
    with pytest.raises(IdentifiabilityError, match="2 samples are left for 2 columns"):
        fit_paper(Observation(("a", "b"), (block(W, np.ones(2)),)))


def test_a_row_with_a_single_sample_beside_a_long_one_is_short_of_rank() -> None:
    """Reversals leave a row hardly any samples where its filters reach far: no traceback."""
    rng = np.random.default_rng(6)
    few, many, x = rng.standard_normal((1, 9)), rng.standard_normal((50, 2)), np.arange(1.0, 10.0)
    long = replace(block(many, many @ x[:2]), touched=np.arange(2))
    observation = Observation(tuple("abcdefghi"), (long, block(few, few @ x, row=1)))
    for fit in (fit_matched(observation), fit_paper(observation)):
        assert fit.solution.undetermined.tolist() == [False] * 2 + [True] * 7
        np.testing.assert_allclose(fit.solution.x[:2], x[:2])


def test_zero_columns_are_left_out_and_named() -> None:
    rng = np.random.default_rng(8)
    W = np.column_stack([rng.standard_normal(40), np.zeros(40), rng.standard_normal(40)])
    fit = fit_paper(Observation(("a", "b", "c"), (block(W, W @ np.array([1.0, 0.0, 2.0])),)))
    assert fit.columns == ("a", "c")
    assert fit.absent == ("b",)
    np.testing.assert_allclose(fit.solution.x, [1.0, 2.0])


def test_refit_keeps_rows_and_weights() -> None:
    _, observation = link_rows(0.01, 0.3)
    fit = fit_matched(observation)
    reduced = refit(fit, ["J", "K"])
    assert reduced.columns == ("J", "K")
    assert reduced.weights == fit.weights
    assert reduced.relative_error > fit.relative_error


def test_terms_norm_ignores_what_is_constant() -> None:
    W = np.column_stack([np.full(4, 1e6), [1.0, -1.0, 1.0, -1.0]])
    assert block(W, np.ones(4)).terms_norm(np.array([1.0, 3.0])) == pytest.approx(6.0)


def test_directions_that_are_gone_do_not_make_a_block_less_noisy() -> None:
    """Rows that leave forces open leave nothing of noise along these: they had counted twice as much."""
    rng = np.random.default_rng(5)
    x, W = np.array([1.0, -2.0]), rng.standard_normal((2, 400, 2))
    Y = W @ x + 0.1 * rng.standard_normal((2, 400))
    W[0, :300], Y[0, :300] = 0.0, 0.0
    blocks = (replace(block(W[0], Y[0]), opened=300.0), block(W[1], Y[1], row=1))
    fit = fit_matched(Observation(("a", "b"), blocks))
    assert fit.weights[0] / fit.weights[1] == pytest.approx(1.0, rel=0.1)


def test_a_further_column_takes_no_weight_from_the_rows_without_a_force() -> None:
    """A noisy force lets its own gain grow at first, and bounded the row that tells the gain."""
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 4000))
    zero, noise = np.zeros(4000), 0.3 * rng.standard_normal((2, 4000))
    # two forces, the first of which holds both terms, and a row of their balance
    forces = (a + 0.02 * b + noise[0], b + noise[1])
    rows = (
        (np.column_stack([a, 0.02 * b, forces[0]]), forces[0]),
        (np.column_stack([zero, b, zero]), forces[1]),
    )
    balance = 1e-3 * rng.standard_normal(4000) + a
    load = (np.column_stack([balance, -a, zero]), zero)
    blocks = tuple(block(W, Y, row=row) for row, (W, Y) in enumerate((*rows, load)))
    observation = Observation(("first", "second", "gain"), blocks)
    alone = fit_matched(
        replace(observation, columns=("first", "second"), blocks=tuple(one.chosen([0, 1]) for one in blocks))
    )
    bounded, heard = fit_matched(observation), fit_matched(observation, further=("gain",))
    assert bounded.weights[-1] < 0.5 * alone.weights[-1]
    assert heard.weights[-1] > 0.9 * alone.weights[-1]
    off = [abs(one.solution.x[0] - one.solution.x[1]) for one in (bounded, heard)]
    assert off[1] < off[0]
