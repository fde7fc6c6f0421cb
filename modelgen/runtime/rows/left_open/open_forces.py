"""Rows that do not depend on a force at some samples: without their parts along what a low-pass makes of it.

A force that is off at one sample enters rows as the low-pass's response to one sample, a pulse. Rows are made
orthogonal to the pulses window by window of the grid, each by itself: what stretches hold is the same however
they are cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.numerics.qr_triangle import tall_triangle, triangle_of
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.row_block import DrawnBlock, InStretches, RowBlock, Stretch
from modelgen.runtime.rows.row_triangles import AT_A_TIME
from modelgen.runtime.rows.thresholds import PULSE_ALIKE, PULSE_WINDOW, TURN_TOLERANCE


def pulse_of(rows: RecordRows, choice: FilterChoice) -> FloatArray:
    """Return what the low-pass of rows makes of one sample of 1, without a unit, shape (2 reach + 1,)."""
    filtering = rows.plan.filtering
    reach = support_samples(choice.filter_order, choice.cutoff_hz, filtering.fs, 0, TURN_TOLERANCE)
    operator: FusedOperator = fused_operator(filtering.low_pass, filtering.fs, fast=rows.plan.fast)
    one = np.zeros(2 * reach + 1)
    one[reach] = 1.0
    return operator.apply(one, 0, len(one))[:, 0]


@dataclass(frozen=True, eq=False)
class OpenForces:
    """Where a force of a row is left open.

    Attributes
    ----------
    samples : array of int, shape (s,)
        Of the record, in rising order.
    pulse : array, shape (2 reach + 1,)
        What the low-pass makes of one of them.
    start, factor : int
        Sample of the record at the grid's first point, and samples from one point to the next.
    """

    samples: IntArray
    pulse: FloatArray
    start: int
    factor: int

    def along(self, place: IntArray) -> FloatArray:
        """Return an orthonormal basis of the pulses at points of the grid, shape (points, directions)."""
        times, reach = self.start + self.factor * place, len(self.pulse) // 2
        felt = slice(*np.searchsorted(self.samples, (times[0] - reach, times[-1] + reach + 1)).tolist())
        apart = times[:, None] - self.samples[felt] + reach
        if not apart.size:
            return np.zeros((len(place), 0))
        inside = (apart >= 0) & (apart < len(self.pulse))
        held = np.where(inside, self.pulse[np.clip(apart, 0, len(self.pulse) - 1)], 0.0)
        # of the smaller product the eigenvalues are squares of singular values
        wide = len(held) < held.shape[1]
        squares, vectors = np.linalg.eigh(held @ held.T if wide else held.T @ held)
        whole = float(np.sum(self.pulse[:: self.factor] ** 2))
        count = squares > PULSE_ALIKE**2 * max(float(squares[-1]), whole)
        basis = vectors[:, count] if wide else held @ (vectors[:, count] / np.sqrt(squares[count]))
        return np.asarray(basis)

    def left(self, part: Stretch) -> tuple[Stretch, int]:
        """Return a stretch of whole windows without the pulses, and along how many directions nothing is."""
        Y, W, taken = part.Y.copy(), part.W.copy(), 0
        edges = np.flatnonzero(np.diff(part.place // PULSE_WINDOW)) + 1
        for window in np.split(np.arange(len(part.place)), edges):
            if not window.size:
                continue
            along = self.along(part.place[window])
            if along.shape[1]:
                at = slice(int(window[0]), int(window[-1]) + 1)
                Y[at] -= along @ (along.T @ Y[at])
                W[at] -= along @ (along.T @ W[at])
                taken += along.shape[1]
        return part._replace(Y=Y, W=W), taken


@dataclass(frozen=True, eq=False)
class OpenedRows:
    """Samples of a block in which a force is open, made again whenever they are asked for."""

    source: InStretches
    forces: OpenForces

    def between(self, start: int, stop: int) -> Stretch:
        """Return the samples used among those points of the grid."""
        return self.counted(start, stop)[0]

    def counted(self, start: int, stop: int) -> tuple[Stretch, int]:
        """Return the same, and along how many directions nothing is left of the windows that these are in."""
        low, high = start // PULSE_WINDOW * PULSE_WINDOW, -(-stop // PULSE_WINDOW) * PULSE_WINDOW
        part, taken = self.forces.left(self.source.between(low, high))
        first, behind = np.searchsorted(part.place, (start, stop)).tolist()
        rows, at = slice(part.rows.start + first, part.rows.start + behind), slice(first, behind)
        return Stretch(rows, part.place[at], part.Y[at], part.W[at]), taken

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
        part, taken = opened.counted(0, block.grid)
        return replace(block.kept(), Y=part.Y, W=part.W, opened=taken)
    triangles: list[FloatArray] = []
    total = 0
    for start in range(0, block.grid, stretch):
        part, taken = opened.counted(start, start + stretch)
        triangles.append(tall_triangle(part.W, part.Y))
        total += taken
        if len(triangles) == AT_A_TIME:
            triangles = [triangle_of(np.concatenate(triangles))]
    summary = replace(block.summary, triangle=triangle_of(np.concatenate(triangles)))
    inside = range(summary.triangle.shape[1] - 2)
    return DrawnBlock(opened, inside, vars(block) | {"summary": summary, "opened": total, "whole": None})


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
    near = np.concatenate([one for one, _ in found])
    certain = np.concatenate([one for _, one in found])
    order = np.lexsort((certain, near))
    near, certain = near[order], certain[order]
    first = np.diff(near, prepend=near[:1] - 1) > 0
    return near[first], certain[first]
