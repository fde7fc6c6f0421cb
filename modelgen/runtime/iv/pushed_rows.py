"""What pushes change in rows of a chain, at all frequencies at once: filtered, differentiated and decimated.

A push changes each channel by a product of spectra, and so do filters and differences: their products are
taken once for all forces that push the same bodies, and only sums that rows hold are transformed back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.power_spectrum import integer_power
from modelgen.runtime.filters.two_sided_kernel import squared_gain
from modelgen.runtime.iv.pushed_chain import Pushed
from modelgen.runtime.rows.filter_sections import Filtering
from modelgen.runtime.rows.record_rows import RecordRows


class PushedRows:
    """Sums of filtered signals of one record, as pushes change them; what is known of one push is kept."""

    def __init__(self, rows: RecordRows) -> None:
        """Take how signals are filtered, and the samples that are kept."""
        self.rows = rows
        self._last: dict[tuple[float, ...], dict[tuple[tuple[str, float], ...], ComplexArray]] = {}

    def mixed(self, pushed: Pushed, sums: Sequence[Mapping[str, float]]) -> FloatArray:
        """Return what a push adds to sums of signals at all samples kept, shape (sums, grid).

        Each sum has a weight a signal, in SI. The ends of the record, which filters reach from outside of the
        grid, are those of a force that goes on to where it began.
        """
        grid = self.rows.grid
        found = np.zeros((len(sums), len(grid)))
        for line, weights in zip(found, sums, strict=True):
            if weights:
                line[:] = pushed.answered(self._way(pushed, weights))[grid.start : grid.stop : grid.step]
        return found

    def _way(self, pushed: Pushed, weights: Mapping[str, float]) -> ComplexArray:
        """Return a sum of signals per unit of a push at all frequencies, shape (frequencies,)."""
        if pushed.push not in self._last:
            self._last.clear()  # they are as long as the record
            self._last[pushed.push] = {}
        known, asked = self._last[pushed.push], tuple(weights.items())
        if asked not in known:
            plan, passed = self.rows.plan, dict[str, ComplexArray]()
            for key, weight in asked:
                channel, column = plan.signals[key]
                order = plan.operators[channel].derivatives[column]
                own = passed.setdefault(channel, np.zeros(pushed.size // 2 + 1, dtype=complex))
                part = own.imag if order % 2 else own.real
                part += (-weight if order % 4 > 1 else weight) * _gain(plan.filtering, pushed.size, order)
            read = pushed.ways(passed)
            known[asked] = np.sum([own * read[channel] for channel, own in passed.items()], axis=0)
        return known[asked]


def _gain(filtering: Filtering, size: int, order: int) -> FloatArray:
    """Return what filter and differences make of the lines of a transform of `size` samples, over 1j**order.

    In 1/s^order, shape (size // 2 + 1,), not to be changed.
    """
    gain, slope = _gain_and_slope(filtering, size)
    return gain * integer_power(slope, order) if order else gain


@lru_cache(maxsize=4)  # stretches of a record, and one look after the other, have the same
def _gain_and_slope(filtering: Filtering, size: int) -> tuple[FloatArray, FloatArray]:
    """Return the gain of the filter, and that of one difference over 1j, in 1/s."""
    phase = 2.0 * np.pi * np.fft.rfftfreq(size)
    gain = squared_gain(np.asarray(filtering.linear, dtype=float), np.sin(0.5 * phase) ** 2)
    slope = np.asarray(
        filtering.fs * sum(2.0 * c * np.sin(k * phase) for k, c in enumerate(filtering.stencil, start=1))
    )
    for one in (gain, slope):
        one.flags.writeable = False
    return gain, slope
