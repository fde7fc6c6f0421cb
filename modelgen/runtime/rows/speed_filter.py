"""SpeedFilter: what a reading goes through before the sign of its speed is a direction of motion.

A low-pass at the dynamics keeps noise from turning anything, and takes off what is faster: it does not see
reversals at the end of a chirp. A speed in a wider band tells where noise has not turned it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.thresholds import CERTAIN_SIGN, HIGHEST_CUTOFF, TURNING_ORDER
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.fused_operator import FusedOperator
from modelgen.runtime.filters.two_sided_kernel import Sections
from modelgen.runtime.rows.filter_sections import Filtering


@dataclass(frozen=True)
class SpeedFilter:
    """Low-passed speeds of a reading, at the full rate.

    Attributes
    ----------
    low : FusedOperator
        Below the cut-off of directions.
    wide : FusedOperator, optional
        In a wider band; None where faster motion does not count.
    certain : float
        Speed in SI whose sign behind `wide` is no noise.
    """

    low: FusedOperator
    wide: FusedOperator | None = None
    certain: float = 0.0

    @property
    def margins(self) -> tuple[int, int]:
        """Samples before the first and behind the last one that are looked at."""
        (before, behind), wide = self.low.margins, self.wide.margins if self.wide else (0, 0)
        return max(before, wide[0]), max(behind, wide[1])

    def speed(
        self, filtered: Callable[[FusedOperator, int, int], FloatArray], start: int, count: int
    ) -> FloatArray:
        """Return the speed at samples from `start` on, shape (count,), in SI.

        `filtered` takes an operator, the first sample and how many to what that makes of the reading, shape
        (count, 1).
        """
        low = filtered(self.low, start, count)[:, 0]
        if self.wide is None:
            return low
        wide = filtered(self.wide, start, count)[:, 0]
        return np.where(np.abs(wide) > self.certain, wide, low)


def speed_filter(
    filtering: Filtering, channel: str, operator: Callable[[Sections], FusedOperator]
) -> SpeedFilter:
    """Return the filter of a channel; `operator` makes one, at the full rate, of a low-pass."""
    low, fs = operator(filtering.directions), filtering.fs
    faster = next((one for one in filtering.faster if one.channel == channel), None)
    if faster is None:
        return SpeedFilter(low)
    wide = operator(butterworth(TURNING_ORDER, min(faster.band_hz, HIGHEST_CUTOFF * fs), fs))
    impulse = np.zeros(2 * wide.reach + 1)
    impulse[wide.reach] = sqrt(0.5 * faster.noise * fs)  # its standard deviation
    rms = float(np.linalg.norm(wide.apply(impulse, 0, impulse.size)))
    return SpeedFilter(low, wide, CERTAIN_SIGN * rms)
