"""SpeedFilter: what a reading goes through before the sign of its speed is a direction of motion.

A low-pass at the dynamics keeps noise from turning anything, and takes off what is faster: it does not see
reversals at the end of a chirp. The band up to the cut-off of the rows counts where more than noise is in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.fused_operator import FusedOperator
from modelgen.runtime.filters.reversals import widen
from modelgen.runtime.filters.two_sided_kernel import Sections
from modelgen.runtime.rows.filter_sections import Filtering
from modelgen.runtime.rows.thresholds import FASTER_MOTION


@dataclass(frozen=True)
class SpeedFilter:
    """Low-passed speeds of a reading, at the full rate.

    Attributes
    ----------
    low : FusedOperator
        Below the cut-off of directions.
    wide : FusedOperator, optional
        Below that of the rows; None where faster motion does not count.
    seen : float
        By how much the two speeds differ, in SI, where there is motion in between.
    around : int
        Within how many samples they do: half a period.
    """

    low: FusedOperator
    wide: FusedOperator | None = None
    seen: float = 0.0
    around: int = 0

    @property
    def margins(self) -> tuple[int, int]:
        """Samples before the first and behind the last one that are looked at."""
        every = [one.margins for one in (self.low, self.wide) if one is not None]
        before, behind = (self.around + max(side) for side in zip(*every, strict=True))
        return before, behind

    def speed(
        self, filtered: Callable[[FusedOperator, int, int], FloatArray], start: int, count: int
    ) -> FloatArray:
        """Return the speed at samples from `start` on, shape (count,), in SI.

        `filtered` takes an operator, the first sample and how many to what that makes of the reading, shape
        (count, 1).
        """
        if self.wide is None:
            return filtered(self.low, start, count)[:, 0]
        first, more = start - self.around, count + 2 * self.around
        low, wide = (filtered(one, first, more)[:, 0] for one in (self.low, self.wide))
        moves = widen(np.abs(wide - low) > self.seen, self.around)
        return np.where(moves, wide, low)[self.around : self.around + count]


def speed_filter(
    filtering: Filtering, channel: str, operator: Callable[[Sections], FusedOperator]
) -> SpeedFilter:
    """Return the filter of a channel; `operator` makes one, at the full rate, of a low-pass."""
    low, noise = operator(filtering.directions), dict(filtering.noise).get(channel)
    if noise is None:
        return SpeedFilter(low)
    wide = operator(filtering.low_pass)
    reach = max(low.reach, wide.reach) + 1
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = noise
    rms = float(np.linalg.norm(wide.apply(impulse, 0, impulse.size) - low.apply(impulse, 0, impulse.size)))
    return SpeedFilter(low, wide, FASTER_MOTION * rms, filtering.half_period)
