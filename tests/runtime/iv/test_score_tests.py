"""What a residual says of effects: sizes and moves as a larger fit has them, and silence where nothing is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.score_tests import Span, moves_within, scores
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_at, fit_matched
from modelgen.runtime.rows.observation import Observation
from tests.runtime.least_squares.row_blocks import FloatArray, block

TRUTH = np.array([2.0, -1.0, 0.5])
COLUMNS = ("a", "b", "c")
N = 1500


def effect(name: str) -> Effect:
    return Effect(name, "force", f"{name} acts", "", "add it", lambda simulated: {})


def rows(seed: int, size: float, noise: float = 0.1) -> tuple[Fit, FloatArray]:
    """A fit of one row that lacks an effect of that size, and how the row grows with it."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((N, 3))
    grown = rng.standard_normal(N) + 0.7 * W[:, 0] - 0.4 * W[:, 2]
    Y = W @ TRUTH + size * grown + noise * rng.standard_normal(N)
    fit = fit_matched(Observation(COLUMNS, (block(W, Y),)))
    return fit, grown


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.05, 1.0))
def test_a_score_is_what_a_fit_with_the_effect_as_a_column_finds(seed: int, size: float) -> None:
    fit, grown = rows(seed, size)
    (found,) = scores(Span(fit), [effect("push")], [[grown]])
    (one,) = fit.blocks
    larger = np.linalg.lstsq(np.column_stack([one.W, grown]), one.Y, rcond=None)[0]
    assert found.size == pytest.approx(larger[3], rel=1e-9)
    np.testing.assert_allclose(found.move, larger[:3] - fit.solution.x, rtol=1e-6, atol=1e-9)
    left = one.Y - np.column_stack([one.W, grown]) @ larger
    share = 1.0 - float(left @ left) / float(fit.residuals[0] @ fit.residuals[0])
    assert found.explained == pytest.approx(share, rel=1e-6)
    assert abs(found.size - size) < 6.0 * found.std
    assert found.std == pytest.approx(0.1 / np.sqrt(N), rel=0.4)
    assert found.matters


@pytest.mark.slow
def test_where_nothing_lacks_hardly_anything_matters() -> None:
    count = sum(scores(*_no_effect(seed))[0].matters for seed in range(200))
    # the level is 1 %, and a move that is worth telling on top of that
    assert count <= 6


def test_what_few_instants_tell_has_to_be_more_certain() -> None:
    burst = np.arange(N) < 40
    found = []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        W, push = rng.standard_normal((N, 3)), np.where(burst, 3.0 * rng.standard_normal(N), 0.0)
        Y = W @ TRUTH + np.where(burst, 3.0, 0.1) * rng.standard_normal(N)
        found += scores(Span(fit_matched(Observation(COLUMNS, (block(W, Y),)))), [effect("push")], [[push]])
    certain, likely = sum(one.matters for one in found), sum(one.likely for one in found)
    assert all(one.likely for one in found if one.matters)
    # the level is 1 %: normal quantiles pass it five times over
    assert likely > 10 > certain


def _no_effect(seed: int) -> tuple[Span, list[Effect], list[list[FloatArray]]]:
    fit, grown = rows(seed, 0.0)
    return Span(fit), [effect("push")], [[grown]]


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), mix=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_what_the_columns_hold_cannot_be_told(seed: int, mix: list[float]) -> None:
    fit, _ = rows(seed, 0.3)
    assert scores(Span(fit), [effect("push")], [[fit.blocks[0].W @ np.array(mix)]]) == ()


def test_what_is_estimated_already_is_not_told_again() -> None:
    fit, grown = rows(3, 0.5)
    assert scores(Span(fit), [effect("push")], [[grown]])[0].matters
    assert scores(Span(fit, [[grown]]), [effect("push")], [[grown]]) == ()
    assert scores(Span(fit), [], []) == ()


def test_the_effect_that_explains_most_comes_first() -> None:
    fit, grown = rows(4, 0.5)
    other = np.random.default_rng(9).standard_normal(N)
    found = scores(Span(fit), [effect("other"), effect("push")], [[other], [grown]])
    assert [one.effect.name for one in found] == ["push", "other"]
    assert [one.matters for one in found] == [True, False]


def test_weights_of_rows_do_not_change_what_one_row_says() -> None:
    fit, grown = rows(5, 0.5)
    heavier = fit_at(Observation(COLUMNS, fit.blocks), fit)
    heavier = replace(heavier, weights=tuple(7.0 * weight for weight in fit.weights))
    (one,), (other,) = (scores(Span(each), [effect("push")], [[grown]]) for each in (fit, heavier))
    assert other.size == pytest.approx(one.size, rel=1e-6)
    assert other.std == pytest.approx(one.std, rel=1e-6)


def test_moves_in_physical_parameters_follow_the_slope() -> None:
    fit, grown = rows(6, 0.5)
    slope = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    (found,) = scores(Span(fit, slope=slope), [effect("push")], [[grown]])
    assert found.move.shape == (3,)
    assert found.move[2] == pytest.approx(0.5 * found.move[0] + 0.5 * found.move[1])


def test_what_is_not_estimated_counts_as_far_as_the_residual_leaves_it_open() -> None:
    fit, grown = rows(5, 0.0, noise=300.0)
    (one,) = fit.blocks
    larger = np.linalg.lstsq(one.W, grown, rcond=None)[0]
    # much noise says nothing of a size of 1; little says that there is none
    np.testing.assert_allclose(moves_within(Span(fit), [[grown]]), np.outer(larger, larger), rtol=0.1)
    fit, grown = rows(5, 0.0)
    assert np.all(np.diag(moves_within(Span(fit), [[grown]])) < 1e-4)
    # what only the columns hold is as open as before; a record without it has nothing
    held = [one.W @ TRUTH]
    np.testing.assert_allclose(moves_within(Span(fit), [held]), np.outer(TRUTH, TRUTH), rtol=1e-6)
    assert not np.any(moves_within(Span(fit), [[0.0 * grown]]))


def test_what_may_not_be_there_counts_half_where_the_residual_says_nothing() -> None:
    (loud, grown), (none, other), (there, third) = rows(5, 0.0, noise=500.0), rows(5, 0.0), rows(5, 1.0)
    for fit, column, least, most in (
        (loud, grown, 0.49, 0.51),
        (none, other, 1e-4, 0.05),  # it has no size: its size was not to be found
        (there, third, 0.999, 1.001),
    ):
        certain, doubtful = (np.diag(moves_within(Span(fit), [[column]], one)) for one in (False, True))
        assert np.all(doubtful >= least * certain) and np.all(doubtful <= most * certain)


def test_an_effect_is_seen_in_the_rows_whose_weight_it_has_taken() -> None:
    rng = np.random.default_rng(3)
    sign = np.where(np.arange(N) % 40 < 20, 1.0, -1.0)
    back, ahead = (np.column_stack([rng.standard_normal((N, 2)), one]) for one in (sign, np.ones(N)))
    # ahead, a constant force is friction: what that leaves where the motion goes back takes weight off it
    Y = [W @ TRUTH + 0.5 + 1e-3 * rng.standard_normal(N) for W in (back, ahead)]
    blocks = (block(back, Y[0], record=0), block(ahead, Y[1], record=1))
    fit = fit_matched(Observation(COLUMNS, blocks))
    assert fit.weights[0] < 0.02 * fit.weights[1]
    (found,) = scores(Span(fit), [effect("push")], [[np.ones(N), np.ones(N)]])
    assert found.size == pytest.approx(0.5, rel=0.02)
    assert found.matters


def test_what_a_column_is_but_for_rounding_in_another_row_is_no_effect() -> None:
    rng = np.random.default_rng(4)
    W = np.column_stack([rng.standard_normal((N, 2)), np.ones(N)])
    none, push = np.column_stack([rng.standard_normal((N, 2)), np.zeros(N)]), 1e-9 * rng.standard_normal(N)
    Y = [rows @ TRUTH + 1e-3 * rng.standard_normal(N) for rows in (W, none)]
    fit = fit_matched(Observation(COLUMNS, (block(W, Y[0], row=0), block(none, Y[1], row=1))))
    assert scores(Span(fit), [effect("push")], [[np.ones(N), push]]) == ()


def test_a_late_sensor_is_seen_although_friction_is_nearly_the_same() -> None:
    # an encoder late by a fiftieth of a sample is viscous friction of both its bodies, but for accelerations
    rng = np.random.default_rng(5)
    W, apart = rng.standard_normal((N, 3)), rng.standard_normal(N)
    grown = W[:, 0] - W[:, 2] + 0.01 * apart
    fit = fit_matched(Observation(COLUMNS, (block(W, W @ TRUTH + grown + 1e-3 * rng.standard_normal(N)),)))
    late = replace(effect("late"), kind="delay")
    (found,) = scores(Span(fit), [effect("push"), late], [[grown], [grown]])
    assert found.effect is late
    assert found.matters
    assert found.size == pytest.approx(1.0, rel=0.1)
