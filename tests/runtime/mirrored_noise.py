"""What noise adds to a row on average, from records and their mirror images: what is odd in it cancels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe

ROW, PAIRS, ANOTHER = 1, 3, 5


def lifted_and_expected(
    model: Model, choice: FilterChoice, read: Callable[[float, int], Record], level: float, point: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return by how much the second row leaves more at a point, shape (c,), and what is predicted, (n,) each.

    `read` takes a level of noise and a seed to a record.
    """

    def left(level: float, seed: int = 0) -> FloatArray:
        block = observe(model, [read(level, seed)], choice).blocks[ROW].dense(len(point))
        found = np.full(block.grid, np.nan)
        found[block.place] = block.Y - block.W @ point
        return found

    pairs = [left(level, seed) + left(-level, seed) for seed in range(PAIRS)]
    factor, start = choice.decimation[0], observe(model, [read(0.0, 0)], choice).blocks[ROW].start
    ways = noise_ways(model, read(level, ANOTHER), choice, factor)[ROW]
    at = (np.concatenate([*ways.at]) - start) // factor
    lifted = (0.5 * np.mean(pairs, axis=0) - left(0.0))[at]
    used = np.isfinite(lifted)
    return lifted[used], np.asarray(ways.of_residual(point).means[0])[used]
