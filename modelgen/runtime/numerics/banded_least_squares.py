"""The banded solution: least squares of many small triangles, one front of neighbouring columns at a time.

A row of a chain touches its neighbours' parameters only. Triangles are taken in the order of the columns;
what they have in common with later ones stays in the front, a column that no later one touches is
eliminated from it by QR. The front stays as small as the chain is narrow, so the cost grows linearly with
its length; a tree or a loop needs a wider front, nothing else. (Duff and Reid 1983; George and Heath 1980.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.numerics.qr_triangle import triangle_of

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A diagonal of the scaled triangle below this share of the largest counts as zero.
RANK_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class BandedSolution:
    """X = argmin |Y - W X| and what of (W^T W)^-1 the variances need.

    Attributes
    ----------
    x : array, shape (c,)
    variance : array, shape (c,)
        Diagonal of (W^T W)^-1.
    full_rank : bool
        Whether no column is a combination of others; where it is not, x and variance mean nothing.
    widest : int
        Columns of the widest front: the bandwidth of the problem.
    residual : float
        Norm of Y - W X.
    """

    x: FloatArray
    variance: FloatArray
    full_rank: bool
    widest: int
    residual: float


@dataclass(frozen=True, eq=False)
class _Front:
    """Columns `gone` = solved for `staying` ones: upper x_gone + right x_staying = rhs."""

    gone: IntArray
    staying: IntArray
    upper: FloatArray
    right: FloatArray
    rhs: FloatArray


def solve_banded(triangles: Sequence[FloatArray], columns: Sequence[Sequence[int]], c: int) -> BandedSolution:
    """Solve the least-squares problem whose rows are given by their triangles.

    Parameters
    ----------
    triangles : sequence of array, each of shape (r, k + 1)
        R of [W Y] over the columns that its rows touch, weighted.
    columns : sequence of sequences of int
        These columns, k each.
    c : int
        Number of columns of the problem; each must be touched.
    """
    scale = column_norms(triangles, columns, c)
    order = sorted(range(len(columns)), key=lambda i: (min(columns[i]), max(columns[i])))
    last = np.zeros(c, dtype=np.int64)
    for step, index in enumerate(order):
        last[list(columns[index])] = step
    fronts: list[_Front] = []
    active = np.zeros(0, dtype=np.int64)
    rows = np.zeros((0, 1))
    for step, index in enumerate(order):
        active, rows = _taken(active, rows, np.asarray(columns[index]), triangles[index], scale)
        leaving = last[active] == step
        if leaving.any():
            front, active, rows = _eliminated(active, rows, leaving)
            fronts.append(front)
    diagonal = np.abs(np.concatenate([np.diag(front.upper) for front in fronts]))
    widest = max(len(front.gone) + len(front.staying) for front in fronts)
    full_rank = bool(diagonal.min() > RANK_TOLERANCE * diagonal.max())
    if not full_rank:
        nothing = np.full(c, np.nan)
        return BandedSolution(nothing, nothing, False, widest, np.nan)
    x, variance = _back_substituted(fronts, c)
    return BandedSolution(x / scale, variance / scale**2, True, widest, float(np.linalg.norm(rows)))


def column_norms(triangles: Sequence[FloatArray], columns: Sequence[Sequence[int]], c: int) -> FloatArray:
    """Return the norm of every column of W, shape (c,)."""
    squared = np.zeros(c)
    for triangle, touched in zip(triangles, columns, strict=True):
        squared[list(touched)] += np.sum(triangle[:, :-1] ** 2, axis=0)
    return np.sqrt(squared)


def _taken(
    active: IntArray, rows: FloatArray, touched: IntArray, triangle: FloatArray, scale: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the front with a triangle's rows below it, columns in ascending order."""
    union = np.union1d(active, touched)
    grown = np.zeros((len(rows) + len(triangle), len(union) + 1))
    grown[: len(rows), np.append(np.searchsorted(union, active), len(union))] = rows
    scaled = triangle / np.append(scale[touched], 1.0)
    grown[len(rows) :, np.append(np.searchsorted(union, touched), len(union))] = scaled
    return union, grown


def _eliminated(
    active: IntArray, rows: FloatArray, leaving: npt.NDArray[np.bool_]
) -> tuple[_Front, IntArray, FloatArray]:
    """Return the equations of the columns that leave, and the front without them."""
    gone, staying = active[leaving], active[~leaving]
    place = np.concatenate([np.flatnonzero(leaving), np.flatnonzero(~leaving), [len(active)]])
    R = triangle_of(rows[:, place])
    k = len(gone)
    return _Front(gone, staying, R[:k, :k], R[:k, k:-1], R[:k, -1]), staying, R[k:, k:]


def _back_substituted(fronts: Sequence[_Front], c: int) -> tuple[FloatArray, FloatArray]:
    """Return x and the diagonal of (W^T W)^-1, from the last front to the first.

    The columns that stay in a front are all in the next one, so their part of the inverse is known there
    (Takahashi 1973, by blocks).
    """
    x, variance = np.zeros(c), np.zeros(c)
    known: IntArray = np.zeros(0, dtype=np.int64)
    inverse = np.zeros((0, 0))
    for front in reversed(fronts):
        root = np.linalg.inv(front.upper)
        x[front.gone] = root @ (front.rhs - front.right @ x[front.staying])
        place = np.searchsorted(known, front.staying)
        below = inverse[np.ix_(place, place)]
        across = -root @ front.right
        mixed = across @ below
        corner = root @ root.T + mixed @ across.T
        variance[front.gone] = np.diag(corner)
        joined = np.concatenate([front.gone, front.staying])
        block = np.block([[corner, mixed], [mixed.T, below]])
        sort = np.argsort(joined)
        known, inverse = joined[sort], block[np.ix_(sort, sort)]
    return x, variance
