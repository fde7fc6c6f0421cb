"""What noise of readings does to the lines of a kernel at samples: their slopes, what it adds on average."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import CHANGED_TOGETHER, SLOPE_STEP
from modelgen.runtime.model.arm_kernel import Kernel, Read
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.rows.kernel_lines import formed


@dataclass(frozen=True, eq=False)
class NoisyLines:
    """The lines of a kernel at values of what makes them, shape (samples,) each, and what is noisy of it."""

    kernel: Kernel | DeflectedKernel
    values: Mapping[Read, FloatArray]
    noisy: Set[str]

    def formed(self, values: Mapping[Read, FloatArray]) -> Mapping[str, FloatArray]:
        """Return the lines, shape (samples,) each in SI, with directions as those of samples."""
        kernel = self.kernel
        return formed(
            kernel.at(kernel.point, sampled=True) if isinstance(kernel, DeflectedKernel) else kernel, values
        )

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """The lines without directions of what is given: these jump, and as measured ones have no noise."""
        if not isinstance(self.kernel, DeflectedKernel):
            return tuple(self.kernel.keys)
        sums, speeds = self.kernel.sums, self.kernel.speeds
        directions = {f"{way} {one.name}" for one in speeds for way in ("sign", "forward", "backward")}
        return tuple(
            key for key in self.kernel.keys if not directions.intersection(k for _, k in sums.get(key, ()))
        )

    @cached_property
    def below(self) -> dict[str, dict[Read, FloatArray]]:
        """Slopes of lines that others are made of, shape (samples,) each, in SI."""
        if not isinstance(self.kernel, DeflectedKernel) or not self.kernel.inner.keys:
            return {}
        inner = self.kernel.inner
        reads = {place: self.values[place] for place in inner.reads_of.values()}
        return _slopes(partial(formed, inner), inner.keys, reads, self.noisy)

    def slopes(self) -> dict[str, dict[Read, FloatArray]]:
        """Return d line / d reading, shape (samples,) each, by line and reading; without those that are zero.

        All is in SI. A line that others are made of takes its noise there, differentiated as often as the
        line is.
        """
        found = _slopes(self.formed, self.keys, self.values, self.noisy | self.below.keys())
        for ways in found.values():
            for key, more in [place for place in ways if place[0] in self.below]:
                along = ways.pop((key, more))
                for (channel, order), slope in self.below[key].items():
                    ways[channel, order + more] = ways.get((channel, order + more), 0.0) + along * slope
        return found

    def means(
        self, shared: Callable[[str, Sequence[int]], tuple[Sequence[Read], FloatArray]]
    ) -> dict[str, FloatArray]:
        """Return what noise adds to lines on average, shape (samples,) each, to second order.

        Along each principal axis of the derivatives of a channel's noise it is what deviations to both sides
        add (Julier and Uhlmann 2004). `shared` gives the covariance of such derivatives,
        and which positions that lag stand behind them.
        """
        here = self.formed(self.values)
        found = {key: np.zeros_like(here[key]) for key in self.keys}
        changes: list[Mapping[Read, FloatArray]] = []
        for channel in sorted(self.noisy):
            moves = self._moves(channel)
            orders = sorted({order for ways in moves.values() for order in ways})
            if not orders:
                continue
            late, covariance = shared(channel, orders)
            size = np.sqrt(np.diag(covariance))
            if not size.all():
                continue
            sizes, axes = np.linalg.eigh(covariance / np.outer(size, size))
            for axis in (axes * np.sqrt(np.maximum(sizes, 0.0))).T:
                step = dict(zip([*orders, *late], size * axis, strict=True))
                moved = {
                    read: sum(slope * step[order] for order, slope in ways.items())
                    for read, ways in moves.items()
                }
                moved |= {read: np.array(step[read]) for read in late}
                changes += [{read: sign * by for read, by in moved.items()} for sign in (1.0, -1.0)]
        both = changed(self.formed, self.keys, self.values, changes)
        for key in found:
            for pair in range(0, len(changes), 2):
                found[key] += 0.5 * (both[key][pair] + both[key][pair + 1]) - here[key]
        return found

    def _moves(self, channel: str) -> dict[Read, dict[int, FloatArray]]:
        """Return what changes with the noise of a channel, by its derivatives: their slopes."""
        found: dict[Read, dict[int, FloatArray]] = {}
        for source, order in self.values:
            if source == channel:
                found[source, order] = {order: np.ones(1)}
            for (one, own), slope in self.below.get(source, {}).items():
                if one == channel:
                    found.setdefault((source, order), {})[own + order] = slope
        return found


def _slopes(
    lines: Callable[[Mapping[Read, FloatArray]], Mapping[str, FloatArray]],
    keys: Sequence[str],
    values: Mapping[Read, FloatArray],
    noisy: Set[str],
) -> dict[str, dict[Read, FloatArray]]:
    """Return d line / d value at the samples, by line and what is noisy of the values."""
    steps = {
        read: SLOPE_STEP * (float(np.sqrt(np.mean(value**2))) or 1.0)
        for read, value in values.items()
        if read[0] in noisy
    }
    changes = [{read: np.array(sign * step)} for read, step in steps.items() for sign in (1.0, -1.0)]
    made = changed(lines, keys, values, changes)
    found: dict[str, dict[Read, FloatArray]] = {key: {} for key in keys}
    for place, (read, step) in enumerate(steps.items()):
        for key in keys:
            slope = (made[key][2 * place] - made[key][2 * place + 1]) / (2.0 * step)
            if slope.any():
                found[key][read] = slope
    return found


def changed(
    lines: Callable[[Mapping[Read, FloatArray]], Mapping[str, FloatArray]],
    keys: Sequence[str],
    values: Mapping[Read, FloatArray],
    changes: Sequence[Mapping[Read, FloatArray]],
) -> dict[str, FloatArray]:
    """Return lines where values, shape (N,) each, are changed by each of `changes`, shape (changes, N) each.

    Many changes are made at once, one behind the other: a line takes as long for a few hundred samples as for
    a few thousand. A change of what has no value is that of zero. All are in SI.
    """
    count = len(next(iter(values.values())))
    found = {key: np.zeros((len(changes), count)) for key in keys}
    most = max(1, CHANGED_TOGETHER // count)
    for first in range(0, len(changes), most):
        some = changes[first : first + most]
        known: dict[Read, FloatArray] = {}
        for read in dict.fromkeys([*values, *(read for one in some for read in one)]):
            table = np.tile(values.get(read, np.zeros(count)), (len(some), 1))
            for line, one in zip(table, some, strict=True):
                if read in one:
                    line += one[read]
            known[read] = table.ravel()
        made = lines(known)
        for key in keys:
            found[key][first : first + len(some)] = np.reshape(made[key], (len(some), count))
    return found
