"""KernelLines: what an arm's rows hold that is nonlinear in several signals, formed at the full rate.

Filters do not commute with such lines. Their signals go through one wide low-pass, which differentiates them
and leaves the motion as it is; the lines themselves then go through the low-pass of the rows, as forces do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.model.arm_kernel import Kernel, Read
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.given_directions import Succession
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.lagging import lag_reach
from modelgen.runtime.rows.filter_sections import Filtering

Filtered = Callable[[str, FusedOperator, int, int], FloatArray]


@dataclass(frozen=True, eq=False)
class KernelLines:
    """The lines of a kernel behind a filtering.

    Attributes
    ----------
    kernel : Kernel or DeflectedKernel
    operators : dict
        Channel, or feature, to the operator that gives its derivatives at the full rate.
    inputs : dict
        What the kernel reads to (channel or feature, column of its operator's output).
    low_passes : tuple of FusedOperator
        Filter and decimate a line, by how often they differentiate it.
    stencil, fs : tuple of float, float
        Central difference at a sampling frequency in Hz, for lines that others are made of.
    directions : FusedOperator, optional
        What speeds that rows give go through before their signs are taken, at the full rate.
    """

    kernel: Kernel | DeflectedKernel
    operators: Mapping[str, FusedOperator]
    inputs: Mapping[Read, tuple[str, int]]
    low_passes: tuple[FusedOperator, ...]
    stencil: tuple[float, ...]
    fs: float
    directions: FusedOperator | None = None

    @property
    def margins(self) -> tuple[int, int]:
        """Samples before the first and behind the last one kept that are looked at."""
        inner = np.max([one.margins for one in self.operators.values()], axis=0)
        before, behind = (np.add(inner, self._outer) + self._reach).tolist()
        return before, behind

    @property
    def _outer(self) -> tuple[int, int]:
        turning = self.directions.margins if self.directions else (0, 0)
        felt = lag_reach(self.kernel.lag, self.fs) if isinstance(self.kernel, DeflectedKernel) else 0
        low_pass = np.max([one.margins for one in self.low_passes], axis=0)
        before, behind = (low_pass + turning + felt).tolist()
        return before, behind

    @cached_property
    def _reach(self) -> int:
        return inner_reach(self.kernel, self.stencil)

    def at(self, filtered: Filtered, start: int, count: int) -> dict[str, FloatArray]:
        """Return every line at the samples kept from `start` on, shape (count,) each.

        `filtered` takes a channel, an operator, the first sample and how many to what the operator makes.
        """
        before, behind = self._outer
        lines = self._formed(
            filtered, start - before, before + (count - 1) * self.low_passes[0].factor + 1 + behind
        )
        orders = self.kernel.orders
        return {
            key: self.low_passes[orders.get(key, 0)].apply(lines[key], before, count)[:, 0]
            for key in self.kernel.keys
        }

    def speeds_at(self, filtered: Filtered, start: int, count: int) -> dict[str, FloatArray]:
        """Return speeds that rows give at so many samples from `start` on, by their names, SI, (count,) each.

        They are those of which directions are taken, in front of what these go through.
        """
        if not isinstance(self.kernel, DeflectedKernel):
            return {}
        felt = lag_reach(self.kernel.lag, self.fs)
        lines = self._formed(filtered, start - felt, count + 2 * felt)
        return {one.name: lines[one.key][felt : felt + count] for one in self.kernel.speeds}

    def signals_at(self, filtered: Filtered, start: int, count: int) -> dict[str, FloatArray]:
        """Return what the lines are formed from at so many samples, by the module's names, SI, (count,) each.

        Positions that rows give are among them.
        """
        felt = lag_reach(self.kernel.lag, self.fs) if isinstance(self.kernel, DeflectedKernel) else 0
        known = self._known(filtered, start - felt, count + 2 * felt)
        found = {key: known[place] for key, place in self.kernel.reads_of.items() if place in known}
        if isinstance(self.kernel, DeflectedKernel):
            found |= self._lines(known)
        return {key: line[felt : felt + count] for key, line in found.items()}

    def _formed(self, filtered: Filtered, start: int, count: int) -> Mapping[str, FloatArray]:
        """Return every line at the full rate, shape (count,) each."""
        return self._lines(self._known(filtered, start, count))

    def _known(self, filtered: Filtered, start: int, count: int) -> dict[Read, FloatArray]:
        """Return what lines are formed from at the full rate, shape (count,) each."""
        reach = self._reach
        made = {
            channel: filtered(channel, one, start - reach, count + 2 * reach)
            for channel, one in self.operators.items()
        }
        read = {key: made[channel][:, column] for key, (channel, column) in self.inputs.items()}
        return with_inner(self.kernel, read, self.stencil, self.fs)

    def _lines(self, known: Mapping[Read, FloatArray]) -> Mapping[str, FloatArray]:
        succession = Succession(self.fs, partial(_whole, self.directions) if self.directions else None)
        return formed(self.kernel, known, succession)


def inner_orders(kernel: Kernel | DeflectedKernel) -> dict[str, int]:
    """Return how often the lines that others are made of are differentiated at most, by their keys."""
    if not isinstance(kernel, DeflectedKernel):
        return {}
    keys = frozenset(kernel.inner.keys)
    return {key: order for key, order in sorted(kernel.reads) if key in keys}


def with_inner(
    kernel: Kernel | DeflectedKernel, read: Mapping[Read, FloatArray], stencil: tuple[float, ...], fs: float
) -> dict[Read, FloatArray]:
    """Return what is read, shape (N,) each, and lines that others are made of, with their derivatives.

    These are central differences at the sampling frequency `fs` in Hz, which need some samples at both ends:
    all is shorter by those, unless there are no such lines.
    """
    orders = inner_orders(kernel)
    if not isinstance(kernel, DeflectedKernel) or not orders:
        return dict(read)
    reach = inner_reach(kernel, stencil)
    known = {place: value[reach : len(value) - reach] for place, value in read.items()}
    signals = {key: read[place] for key, place in kernel.inner.reads_of.items()}
    for key, line in kernel.inner.lines(signals).items():
        for order in range(orders[key] + 1):
            line = differentiate(line, 1.0 / fs, 1, stencil) if order else line
            known[key, order] = line[reach : len(line) - reach]
    return known


def inner_reach(kernel: Kernel | DeflectedKernel, stencil: tuple[float, ...]) -> int:
    """Return how many samples at each end `with_inner` takes."""
    return len(stencil) * max(inner_orders(kernel).values(), default=0)


def formed(
    kernel: Kernel | DeflectedKernel, known: Mapping[Read, FloatArray], succession: Succession | None = None
) -> Mapping[str, FloatArray]:
    """Return every line of a kernel, in SI, shape (N,) each, from what `with_inner` returns.

    `succession` says that the samples follow each other without gaps, and how.
    """
    if isinstance(kernel, DeflectedKernel):
        return kernel.lines(known, succession)
    return kernel.lines({key: known[place] for key, place in kernel.reads_of.items()})


def kernel_lines(model: Model, filtering: Filtering, fast: bool | None) -> KernelLines | None:
    """Return the kernel of a model behind a filtering; None where there is none."""
    kernel = model.kernel
    if kernel is None:
        return None
    orders: dict[str, list[int]] = {}
    inputs = {}
    inner = inner_orders(kernel)
    for source, order in dict.fromkeys(kernel.reads):
        if source in inner:
            continue
        inputs[source, order] = (source, len(orders.setdefault(source, [])))
        orders[source].append(order)
    operators = {
        channel: fused_operator(filtering.signals, filtering.fs, tuple(of), 1, filtering.stencil, fast=fast)
        for channel, of in orders.items()
    }
    low_passes = tuple(
        fused_operator(
            filtering.low_pass, filtering.fs, (order,), filtering.factor, filtering.stencil, fast=fast
        )
        for order in range(1 + max(kernel.orders.values(), default=0))
    )
    directions = None
    if isinstance(kernel, DeflectedKernel) and kernel.speeds:
        directions = fused_operator(filtering.directions, filtering.fs, fast=fast)
    return KernelLines(kernel, operators, inputs, low_passes, filtering.stencil, filtering.fs, directions)


def _whole(operator: FusedOperator, samples: FloatArray) -> FloatArray:
    """Return what an operator at the full rate makes of all samples, shape (N,) as they."""
    return operator.apply(samples, 0, len(samples))[:, 0]
