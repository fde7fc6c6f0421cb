"""Digits at a cut-off, moves from another one that noise does not explain, and bias."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.diagnostics.tried_cutoff import Tried
from modelgen.runtime.filter_choice.filter_choice import FilterChoice

CHOICE = FilterChoice(4, 40.0, 10.0, (10,), 30.0, 30.0, (), (), ())
RNG = np.random.default_rng(3)
STRETCHES = RNG.standard_normal((1024, 2)) / 32.0


def tried(x: float, square_error: float, influence: np.ndarray = STRETCHES, bias: float = 0.0) -> Tried:
    both = np.array([1.0, x])
    square = np.array([1e-4, square_error])
    return Tried(CHOICE, ("a", "b"), both, both, square, np.array([0.0, bias]), [influence], False, 0.0, 1.0)


def test_digits_are_those_of_errors_and_moves() -> None:
    size = np.ones(2)
    assert tried(1.0, 1e-4).digits(size) == pytest.approx(4.0)
    assert tried(1.0, np.inf).digits(size) == pytest.approx(2.0)
    assert tried(1.0, 1e-4).digits(size, np.array([0.0, 0.09])) == pytest.approx(2.0 - 0.5 * np.log10(0.0901))


def test_noise_that_both_estimates_hold_explains_no_move() -> None:
    low, high = tried(1.0, 0.2, 0.45 * STRETCHES), tried(1.3, 0.2, 0.44 * STRETCHES)
    # deviations of 0.45 and 0.44, a difference of 0.01: a move of 0.3 is the model's
    assert high.moved_from(low)[1] == pytest.approx(0.09, rel=0.02)
    assert high.moved_from(low)[0] == 0.0
    # noise of their own explains it
    other = tried(1.0, 0.2, 0.45 * RNG.standard_normal((1024, 2)) / 32.0)
    assert not high.moved_from(other).any()
    # and so do biases that are predicted, and what is not known at all
    assert not high.moved_from(tried(1.0, 0.2, 0.45 * STRETCHES, bias=0.2)).any()
    assert not tried(1.3, np.inf, 0.44 * STRETCHES).moved_from(low).any()


def test_an_error_that_is_mainly_bias_is_pulled() -> None:
    assert not tried(1.0, 0.04, bias=0.05).pulled
    assert tried(1.0, 0.04, bias=0.15).pulled
