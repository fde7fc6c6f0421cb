"""Steps that shrink by a constant share are combined; what is held stays, what grows is left alone."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.anderson import AndersonSteps

SOLUTION = np.array([3.0, -2.0, 1e-6])
SHARES = np.array([[0.8, 0.1, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.3]])
SCALE = np.array([1.0, 1.0, 1e-6])


def rounds(combined: bool, most: int = 200) -> int:
    steps, x = AndersonSteps(), np.zeros(3)
    for done in range(1, most):
        move = SHARES @ (x - SOLUTION) + SOLUTION - x
        if np.all(np.abs(move) < 1e-9 * SCALE):
            return done
        x = x + (steps.combined(x, move, SCALE) if combined else move)
    return most


def test_steps_that_shrink_slowly_come_to_rest_in_a_few_rounds() -> None:
    assert rounds(combined=False) > 80
    assert rounds(combined=True) < 12


def test_what_is_held_stays_in_place_to_the_last_digit() -> None:
    steps, x = AndersonSteps(), np.array([0.0, 5.0])
    for _ in range(5):
        move = np.array([0.0, -0.3 * x[1]])
        found = steps.combined(x, move, np.array([0.0, 1.0]))
        assert found[0] == 0.0
        x = x + found


def test_growing_steps_are_taken_as_they_are() -> None:
    steps, moves = AndersonSteps(), list[FloatArray]()
    x = np.array([1.0])
    for _ in range(4):
        move = 2.0 * x
        moves.append(steps.combined(x, move, np.ones(1)) - move)
        x = x + move
    assert not np.any(moves)
