"""The best of many trials of a function that has no derivative."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.progress import counted
from modelgen.runtime.planning.thresholds import CHANGED


def best_of_trials(
    cost: Callable[[FloatArray], float], starts: Sequence[FloatArray], rounds: int, seed: int = 0
) -> tuple[float, FloatArray]:
    """Return the least cost and its variables: random steps that grow with success and shrink without.

    Variables, and each of the starts, are dimensionless, shape (k,): a step of 1 should be a large one for
    all of them. Each step changes a few variables only: most improvements concern one thing.

    A (1+1) evolution strategy with the one-fifth rule (Rechenberg 1973); seeded.
    """
    rng = np.random.default_rng(seed)
    value, best = min(((cost(start), start) for start in starts), key=lambda pair: pair[0])
    step = 0.2
    for _ in counted(range(1, rounds), "trials"):
        move = rng.standard_normal(best.size) * (rng.random(best.size) < CHANGED)
        candidate = best + step * move
        found = cost(candidate)
        if found < value:
            best, value, step = candidate, found, min(1.5 * step, 1.0)
        else:
            step = max(0.94 * step, 0.01)
    return value, best
