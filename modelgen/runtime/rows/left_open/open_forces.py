"""Rows that hardly depend on a force at some samples: what a low-pass makes of it weighs next to nothing.

A force that is off at one sample enters rows as the low-pass's response to one sample, a pulse. Rows are
multiplied by the inverse of a covariance, the unit matrix and much of every pulse: each then holds no more of
it than `PULSE_LEFT`, and sums of pulses that are small, as neighbours differ little, stay. That is done
window by window of the grid, each by itself: what stretches hold is the same however they are cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.numerics.lagging import MOST_SAMPLES
from modelgen.runtime.numerics.qr_triangle import tall_triangle, triangle_of
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.row_block import DrawnBlock, InStretches, RowBlock, Stretch
from modelgen.runtime.rows.row_triangles import AT_A_TIME
from modelgen.runtime.rows.thresholds import (
    POWERS_APART,
    PULSE_LEFT,
    PULSE_WINDOW,
    PULSES_ALIKE,
    TURN_TOLERANCE,
    WINDOWS,
)


def pulses_of(
    rows: RecordRows, choice: FilterChoice, orders: tuple[int, ...] = (0,), lags: Sequence[float] = (0.0,)
) -> FloatArray:
    """Return derivatives of what the low-pass of rows makes of one sample of 1, (pulses, 2 reach + 1).

    They have no unit: all are as large as the pulse itself. The last of the `orders` is that of positions
    which springs give, each of which lags by D / K, one of the `lags` in s; those that are nearly sums of
    others are left out.
    """
    filtering, every = rows.plan.filtering, (0, *orders)
    reach = support_samples(choice.filter_order, choice.cutoff_hz, filtering.fs, 0, TURN_TOLERANCE)
    felt = -log(TURN_TOLERANCE) * max(abs(lag) for lag in lags) * filtering.fs
    reach += round(min(felt, MOST_SAMPLES))
    operator: FusedOperator = fused_operator(
        filtering.low_pass, filtering.fs, every, 1, filtering.stencil, fast=rows.plan.fast
    )
    before, behind = operator.margins
    one = np.zeros(before + 2 * reach + 1 + behind)
    one[before + reach] = 1.0
    found = operator.apply(one, before, 2 * reach + 1).T
    size, pulses = float(np.linalg.norm(found[0])), found[1:]
    if any(lags):
        line = np.fft.rfft(found[-1])
        rates = 2j * np.pi * filtering.fs * np.fft.rfftfreq(2 * reach + 1)
        later = [np.fft.irfft(line / (1.0 + rates * lag), 2 * reach + 1) for lag in sorted(lags, key=abs)]
        pulses = _unlike(np.array([*found[1:-1], *later]))
    return np.asarray(size * pulses / np.linalg.norm(pulses, axis=1)[:, None])


def _unlike(pulses: FloatArray) -> FloatArray:
    """Return those of some pulses, shape (pulses, n), that are not nearly sums of the ones before."""
    kept: list[int] = []
    basis = np.zeros((0, pulses.shape[1]))
    for place, pulse in enumerate(pulses):
        rest = pulse - basis.T @ (basis @ pulse)
        left = float(np.linalg.norm(rest))
        if left > PULSES_ALIKE * float(np.linalg.norm(pulse)):
            kept.append(place)
            basis = np.vstack([basis, rest / left])
    return pulses[kept]


@dataclass(frozen=True, eq=False)
class OpenForces:
    """Where a force of a row is left open.

    Attributes
    ----------
    samples : array of int, shape (s,)
        Of the record, in rising order.
    pulses : array, shape (pulses, 2 reach + 1)
        What the low-pass makes of one of them, in any sum of these.
    start, factor : int
        Sample of the record at the grid's first point, and samples from one point to the next.
    """

    samples: IntArray
    pulses: FloatArray
    start: int
    factor: int

    @property
    def reach(self) -> int:
        """How many samples off a pulse is felt."""
        return int(self.pulses.shape[1] // 2)

    @cached_property
    def power(self) -> float:
        """What of the sum of squares of a pulse, at points of the grid, the unit matrix is to weigh."""
        return PULSE_LEFT**2 * float(np.sum(self.pulses[0, :: self.factor] ** 2))

    @cached_property
    def products(self) -> FloatArray:
        """Products of pulses with themselves, so many points later, by samples, (2 reach + 1, points)."""
        length = self.pulses.shape[1]
        found = np.zeros((length, min(-(-length // self.factor), PULSE_WINDOW)))
        for count in range(found.shape[1]):
            shift = count * self.factor
            later = self.pulses[:, : length - shift] * self.pulses[:, shift:]
            found[: length - shift, count] = np.sum(later, axis=0)
        return found[::-1]

    def feel(self, windows: IntArray) -> IntArray:
        """Return those of some windows of the grid, shape (w,), that feel an open force."""
        first = self.start + self.factor * PULSE_WINDOW * windows
        last = first + self.factor * (PULSE_WINDOW - 1)
        low, high = np.searchsorted(self.samples, (first - self.reach, last + self.reach + 1))
        return np.asarray(windows[high > low])

    def covariance(self, windows: IntArray, used: BoolArray) -> FloatArray:
        """Return sums of products of the pulses at points that are used, and the unit matrix times `power`.

        Parameters
        ----------
        windows : array of int, shape (w,)
        used : array of bool, shape (w, points of a window)

        Returns
        -------
        array, shape (points that feel the same, w points)
            Of the matrix of all points of the windows the diagonal, and those below it.
        """
        first = self.start + self.factor * PULSE_WINDOW * windows - self.reach
        length = self.pulses.shape[1]
        size = self.factor * (PULSE_WINDOW - 1) + length
        opened = np.zeros((len(windows), size))
        for line, low in zip(opened, first.tolist(), strict=True):
            inside = slice(*np.searchsorted(self.samples, (low, low + size)).tolist())
            line[self.samples[inside] - low] = 1.0
        near = sliding_window_view(opened, length, axis=1)[:, :: self.factor]
        every, found = bool(used.all()), np.array(self.products.T @ near.reshape(-1, length).T)
        for later, band in enumerate(found.reshape(-1, *used.shape)):
            behind = PULSE_WINDOW - later
            band[:, behind:] = 0.0
            if not every:
                band[:, :behind] *= used[:, later:] & used[:, :behind]
        found[0] += self.power
        return found

    def parts(self, place: IntArray) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
        """Yield which of some points of the grid, shape (n,), feel the forces, some windows at a time.

        With them come their places among all points of these windows, and the covariance.
        """
        of, at = np.divmod(place, PULSE_WINDOW)
        felt = self.feel(np.unique(of))
        for windows in np.split(felt, range(WINDOWS, len(felt), WINDOWS)) if felt.size else ():
            rows = np.flatnonzero(np.isin(of, windows))
            inside = PULSE_WINDOW * np.searchsorted(windows, of[rows]) + at[rows]
            used = np.zeros((len(windows), PULSE_WINDOW), dtype=bool)
            used.flat[inside] = True
            yield rows, inside, self.covariance(windows, used)

    def left(self, part: Stretch) -> Stretch:
        """Return a stretch of whole windows that leaves the forces open."""
        from scipy.linalg import solveh_banded

        Y, W = part.Y.copy(), part.W.copy()
        for rows, inside, band in self.parts(part.place):
            lines = np.zeros((band.shape[1], W.shape[1] + 1), order="F")
            lines[inside, :-1], lines[inside, -1] = W[rows], Y[rows]
            lines = solveh_banded(band, lines, True, True, lower=True, check_finite=False)
            W[rows], Y[rows] = self.power * lines[inside, :-1], self.power * lines[inside, -1]
        return part._replace(Y=Y, W=W)

    def directions(self, place: IntArray) -> float:
        """Return along how many directions nothing is left of rows at points of the grid, shape (n,).

        A direction of which a part is left counts in part: their number is that of the points less what the
        logarithm of the covariance's determinant changes by with that of `power`.
        """
        from scipy.linalg import cholesky_banded

        taken, near = 0.0, np.array([-POWERS_APART, POWERS_APART])
        for _, _, band in self.parts(place):
            logs = []
            for more in self.power * np.expm1(near):
                moved = band.copy()
                moved[0] += more
                logs.append(2.0 * float(np.sum(np.log(cholesky_banded(moved, True, True, False)[0]))))
            taken += band.shape[1] - (logs[1] - logs[0]) / (near[1] - near[0])
        return taken


@dataclass(frozen=True, eq=False)
class OpenedRows:
    """Samples of a block in which a force is open, made again whenever they are asked for."""

    source: InStretches
    forces: OpenForces

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""
        low, high = start // PULSE_WINDOW * PULSE_WINDOW, -(-stop // PULSE_WINDOW) * PULSE_WINDOW
        part = self.forces.left(self.source.between(low, high))
        first, behind = np.searchsorted(part.place, (start, stop)).tolist()
        rows, at = slice(part.rows.start + first, part.rows.start + behind), slice(first, behind)
        return Stretch(rows, part.place[at], part.Y[at], part.W[at])

    def longest_run(self, most: int) -> Stretch:
        """Return the longest stretch without a gap, or so many of its first samples."""
        found = self.source.longest_run(most)
        return self.between(int(found.place[0]), int(found.place[-1]) + 1) if len(found.place) else found


def with_open_forces(block: RowBlock, forces: OpenForces, stretch: int) -> RowBlock:
    """Return a block whose rows leave forces open; made again in stretches of so many points if it is."""
    if not forces.samples.size or not block.count:
        return block
    opened = OpenedRows(block, forces)
    if block.in_memory:
        part = opened.between(0, block.grid)
        taken = forces.directions(part.place)
        return replace(block.kept(), Y=part.Y, W=part.W, opened=taken, opening=forces.left)
    triangles: list[FloatArray] = []
    taken = 0.0
    for start in range(0, block.grid, stretch):
        part = opened.between(start, start + stretch)
        triangles.append(tall_triangle(part.W, part.Y))
        taken += forces.directions(part.place)
        if len(triangles) == AT_A_TIME:
            triangles = [triangle_of(np.concatenate(triangles))]
    summary = replace(block.summary, triangle=triangle_of(np.concatenate(triangles)), opened=taken)
    inside = range(summary.triangle.shape[1] - 2)
    return DrawnBlock(
        opened, inside, vars(block) | {"summary": summary, "opened": taken, "opening": forces, "whole": None}
    )


def least_certain(near: IntArray, certain: FloatArray, factor: int, most: int) -> IntArray:
    """Return those of some samples that lie in so many intervals of the grid, the least certain ones.

    Of pulses nearer to each other than a quarter of an interval one stands for all.

    Parameters
    ----------
    near : array of int, shape (s,)
        Samples of a record.
    certain : array, shape (s,)
        How certain each is, in any unit.
    factor : int
        Samples from one point of the grid to the next.
    most : int
    """
    intervals, of = np.unique(near // factor, return_inverse=True)
    least = np.full(len(intervals), np.inf)
    np.minimum.at(least, of, certain)
    rank = np.empty(len(intervals), dtype=np.int64)
    rank[np.argsort(least, kind="stable")] = np.arange(len(intervals))
    near = near[rank[of] < most]
    return near[np.diff(near // max(1, factor // 4), prepend=-1) > 0]


def joined(found: Sequence[tuple[IntArray, FloatArray]]) -> tuple[IntArray, FloatArray]:
    """Return samples and how certain each is, shape (s,) each, the least where several say so."""
    if len(found) == 1:
        return found[0]
    near = np.concatenate([one for one, _ in found])
    certain = np.concatenate([one for _, one in found])
    order = np.lexsort((certain, near))
    near, certain = near[order], certain[order]
    first = np.diff(near, prepend=near[:1] - 1) > 0
    return near[first], certain[first]
