"""Iterations that go round are noticed; those that shrink, creep or wander are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.cycles import LONGEST_CYCLE, MEMORY, Passed

SCALE = np.array([1.0, 1e-3])


def noticed(place: Callable[[int], FloatArray], rounds: int = 60) -> int | None:
    """The round at which a cycle is told."""
    passed = Passed()
    return next((k for k in range(rounds) if passed.again(place(k) * SCALE, SCALE)), None)


@pytest.mark.parametrize("length", range(2, LONGEST_CYCLE + 1))
@pytest.mark.parametrize("before", [0, 5])
def test_a_cycle_is_noticed_once_it_was_passed_and_a_memory_more(length: int, before: int) -> None:
    around = np.random.default_rng(length).standard_normal((length, 2))
    found = noticed(
        lambda k: 30.0 * np.ones(2) * (before - k) if k < before else around[(k - before) % length]
    )
    assert found == before + length + MEMORY - 1


@pytest.mark.parametrize(
    "place",
    [
        lambda k: np.array([0.1 * k, 0.0]),  # creeps
        lambda k: 0.9**k * np.array([np.cos(k * np.pi / 3.0), np.sin(k * np.pi / 3.0)]),  # comes to rest
        lambda k: 0.97**k * np.array([(-1.0) ** k, 1.0]),
        lambda k: np.random.default_rng(k).standard_normal(2),
        lambda k: np.array([np.cos(k), np.sin(k)]),  # a circle that does not close in eight rounds
    ],
)
def test_nothing_else_is_a_cycle(place: Callable[[int], FloatArray]) -> None:
    assert noticed(place, 18) is None
