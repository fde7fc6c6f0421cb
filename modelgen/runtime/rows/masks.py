"""Which samples of a chunk a row must not use: the masks of `observation`, in stretches of a record.

A mask looks at velocities around a sample, and at one number of the whole record: the speed below which a
mass stands still.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.reversals import reversals, standstills, widen
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.filtered_record import DIRECTION_TOLERANCE, SUPPORT_TOLERANCE
from modelgen.runtime.rows.observation import STANDSTILL_PERIODS, direction_keys

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class RowMask:
    """The rule of one row: velocities to look at, how far around, and how long a standstill must last.

    `shortest` is None where every reversal counts.
    """

    keys: tuple[str, ...]
    reach: int
    shortest: int | None

    @property
    def halo(self) -> int:
        """Samples around a chunk within which velocities matter."""
        return self.reach + (self.shortest or 1) + 1 if self.keys else 0

    def of(self, chunk: Chunk, thresholds: Mapping[str, float]) -> BoolArray:
        """Return which of the chunk's samples kept are masked, shape (count,)."""
        masked = np.zeros(chunk.count, dtype=bool)
        for key in self.keys:
            low, high = chunk.start - self.halo, chunk.stop + self.halo
            velocity = chunk.direction(key, low, high)
            # beyond the record there is its mirror image: no rest goes on there
            inside = slice(max(-low, 0), min(high, chunk.source.n) - low)
            marked = np.zeros(len(velocity), dtype=bool)
            if self.shortest is None:
                marked[inside] = reversals(velocity[inside], thresholds[key])
            else:
                marked[inside] = standstills(velocity[inside], self.shortest, thresholds[key])
            if marked.any():
                wide = widen(marked, self.reach)[self.halo : -self.halo]
                masked |= wide[:: chunk.plan.filtering.factor]
        return masked


def row_masks(model: Model, choice: FilterChoice, fs: float) -> tuple[RowMask, ...]:
    """Return the mask of every row, for matched filtering at a sampling frequency in Hz."""
    order = choice.filter_order

    def reach(derivative: int) -> int:
        return support_samples(order, choice.cutoff_hz, fs, derivative, SUPPORT_TOLERANCE)

    late = support_samples(order, choice.direction_cutoff_hz, fs, 0, DIRECTION_TOLERANCE)
    shortest = int(np.ceil(STANDSTILL_PERIODS * fs / choice.cutoff_hz))
    found = []
    for row, info in enumerate(model.rows):
        if info.reversals:
            # the row differentiates the friction as often as its order exceeds that of a motion: a jump
            # enters as an impulse, differentiated once less
            far = max(reach(k) for k in range(max(1, info.order - 2))) + late
            found.append(RowMask(tuple(info.reversals), far, None))
        else:
            found.append(RowMask(direction_keys(model, row), reach(0) + late, shortest))
    return tuple(found)
