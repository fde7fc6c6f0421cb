"""What could stand in the place of an effect that is estimated, and what that leaves open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.other_explanations import Looked, other_explanations
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from tests.runtime.least_squares.row_blocks import FloatArray, block

N = 800


def effect(name: str, negative: str = "it acts") -> Effect:
    return Effect(name, "force", "it acts", negative, "add it", lambda simulated: {})


def freed(
    seed: int, size: float = 0.4, spanned: float = 0.8
) -> tuple[Fit, FloatArray, float, np.random.Generator]:
    """Rows with an effect of this size estimated and subtracted, how they grow with it, and its deviation."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((N, 2))
    grown = rng.standard_normal(N) + spanned * W[:, 0]
    Y = W @ np.array([2.0, -1.0]) + size * grown + 0.1 * rng.standard_normal(N)
    larger = np.linalg.lstsq(np.column_stack([W, grown]), Y, rcond=None)[0]
    fit = fit_matched(Observation(("a", "b"), (block(W, Y - larger[2] * grown),)))
    return fit, grown, float(larger[2]), rng


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), mix=st.floats(-2.0, 2.0), scale=st.floats(0.2, 5.0))
def test_what_explains_the_same_widens_by_what_the_parameters_would_move(
    seed: int, mix: float, scale: float
) -> None:
    fit, grown, size, _ = freed(seed)
    (one,) = fit.blocks
    other = scale * (grown + mix * one.W[:, 1])
    looked = Looked((), [[grown]], [[other]])
    found, drift = other_explanations(fit, [effect("push")], [size], [0.004], [effect("pull")], looked)
    ((named, step),) = found[0]
    assert named.name == "pull"
    assert step == pytest.approx(size / scale, rel=1e-6)
    # the same but for a multiple of a column, which that column takes back
    expected = np.diag([0.0, (mix * size) ** 2])
    np.testing.assert_allclose(drift, expected, atol=1e-9 * (1.0 + (mix * size) ** 2))


@pytest.mark.parametrize(("spanned", "told"), [(0.1, True), (3.0, False)])
def test_a_large_step_is_told_where_it_is_no_sum_of_the_columns(spanned: float, told: bool) -> None:
    fit, grown, size, _ = freed(3, 20.0, spanned)
    other = grown + 0.1 * fit.blocks[0].W[:, 1]
    looked = Looked((), [[grown]], [[other]])
    (found,), drift = other_explanations(fit, [effect("push")], [size], [0.004], [effect("pull")], looked)
    assert bool(found) == told == bool(drift.any())


@pytest.mark.parametrize("seed", range(5))
def test_what_explains_less_does_not(seed: int) -> None:
    fit, grown, size, rng = freed(seed)
    others = [grown + 0.5 * rng.standard_normal(N), rng.standard_normal(N)]
    looked = Looked((), [[grown]], [[one] for one in others])
    effects = [effect("near"), effect("far")]
    found, drift = other_explanations(fit, [effect("push")], [size], [0.004], effects, looked)
    assert found == [[]]
    assert not drift.any()


def test_what_physics_forbids_is_no_explanation() -> None:
    fit, grown, size, _ = freed(1)
    looked = Looked((), [[grown]], [[-grown]])
    only = effect("pull", negative="")
    assert other_explanations(fit, [effect("push")], [size], [0.004], [only], looked)[0] == [[]]


def test_forms_of_one_thing_are_told_apart_only_beyond_what_rows_hold_exactly() -> None:
    fit, grown, size, rng = freed(2)
    near = grown + 0.001 * rng.standard_normal(N)
    looked = Looked((), [[grown]], [[near]])
    form = effect("form")
    own = replace(effect("push"), forms=(form,))
    # at this deviation chi square tells them apart by more than the limit
    sharp = 1e-6
    assert other_explanations(fit, [effect("push")], [size], [sharp], [form], looked)[0] == [[]]
    assert [one.name for one, _ in other_explanations(fit, [own], [size], [sharp], [form], looked)[0][0]] == [
        "form"
    ]


def test_others_are_judged_with_all_the_rest_estimated() -> None:
    """Alone, each half would be a poor stand-in; with the rest it says the same, and moves little."""
    rng = np.random.default_rng(3)
    W = rng.standard_normal((N, 2))
    first, second = rng.standard_normal((2, N))
    Y = W @ np.array([2.0, -1.0]) + 0.1 * rng.standard_normal(N)
    fit = fit_matched(Observation(("a", "b"), (block(W, Y),)))
    halves = [first + second + 0.5 * W[:, 0], first - second - 0.5 * W[:, 0]]
    looked = Looked((), [[first], [second]], [[one] for one in halves])
    _, drift = other_explanations(
        fit, [effect("f"), effect("s")], [0.4, 0.4], [0.004, 0.004], [effect("u"), effect("v")], looked
    )
    # each moves the first parameter by half a size, and nothing else
    np.testing.assert_allclose(drift, np.diag([2.0 * 0.2**2, 0.0]), rtol=0.1, atol=1e-3)
