"""Iterative refinement of a least-squares solution, with its residuals in twice the working precision.

Where the residual is large and the columns nearly dependent, rounding in the residual alone costs twice as
many digits as the columns do. Solving for the residual together with the solution (the augmented system of
Björck, BIT 7, 1967, 257-278) wins them back. Products and sums keep what they round off (Dekker, Numer. Math.
18, 1971), so that no wider type is needed, which not every machine has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.regressor import Regressor, regressor

Parts = Sequence[tuple[FloatArray | Regressor, FloatArray]]

# Pieces that come to so many numbers are worked on as one: steps on short ones cost as much as on long ones.
ONE_PIECE = 1 << 16
SPLITTER = 2.0**27 + 1.0  # splits 53 bits into two halves whose products are exact
ROUNDS = 2
# A step of less than so much of each number is one of their own rounding: another round would find as much.
NOTHING = 4.0 * float(np.finfo(float).eps)


def refined(parts: Parts, x: FloatArray, inverse: FloatArray) -> FloatArray:
    """Return the solution of W^T (Y - W x) = 0, improved from an approximate one.

    Parameters
    ----------
    parts : sequence of (array or Regressor, array)
        W, shape (r, c), and Y, shape (r,), in pieces of some rows each, which every pass may make anew. W is
        of full rank; its condition number squared must stay below the inverse of the rounding unit.
    x : array, shape (c,)
    inverse : array, shape (c, c)
        (W^T W)^-1, to a few digits.
    """
    parts = _joined(parts)
    residuals = [Y - regressor(W).times(x) for W, Y in parts]
    for _ in range(ROUNDS):
        gradient = np.zeros(len(x))
        defects = []
        for (W, Y), residual in zip(parts, residuals, strict=True):
            of = regressor(W)
            lines = _split(np.ascontiguousarray(of.samples.T))
            defect = _defect(lines, Y, of.own(x), residual)
            gradient += of.spread(of.samples.T @ defect + _projection(lines, residual))
            defects.append(defect)
        step = inverse @ gradient
        x = x + step
        if np.all(np.abs(step) <= NOTHING * np.abs(x)):
            break
        residuals = [
            residual + (defect - regressor(W).times(step))
            for (W, _), residual, defect in zip(parts, residuals, defects, strict=True)
        ]
    return x


def _joined(parts: Parts) -> Parts:
    """Return few rows as one piece: columns that only some have are zero in the others."""
    every, rows = list[tuple[Regressor, FloatArray]](), 0
    for W, Y in parts:
        every.append((regressor(W), Y))
        mix, columns = every[0][0].mix, every[0][0].columns
        lines, rows = columns if mix is None else len(mix), rows + len(Y)
        if rows * lines > ONE_PIECE:
            return parts
    if len(every) < 2:
        return parts
    samples = [replace(of, mix=None, columns=lines).dense() for of, _ in every]
    alike = Regressor(np.concatenate(samples), None, mix, columns)
    return [(alike, np.concatenate([Y for _, Y in every]))]


class _Split(NamedTuple):
    """Numbers, and two halves that add up to them and whose products are exact."""

    whole: FloatArray
    high: FloatArray
    low: FloatArray


def _split(a: FloatArray) -> _Split:
    shifted = SPLITTER * a
    high = shifted - (shifted - a)
    return _Split(a, high, a - high)


def _defect(lines: _Split, Y: FloatArray, x: FloatArray, residual: FloatArray) -> FloatArray:
    """Return Y - residual - W x, shape (r,), of columns of W in lines, (c, r)."""
    total, lost = _sum(Y, -residual)
    values = _split(-x)
    for column, value in zip(zip(*lines, strict=True), zip(*values, strict=True), strict=True):
        product, below = _product(_Split(*column), _Split(*value))
        total, more = _sum(total, product)
        lost = lost + (below + more)
    return total + lost


def _projection(lines: _Split, residual: FloatArray) -> FloatArray:
    """Return W^T residual, shape (c,), of columns of W in lines, (c, r), adding up by halves."""
    if not len(residual):  # every sample of this piece is masked
        return np.zeros(len(lines.whole))
    total, lost = _product(lines, _split(residual))
    while total.shape[1] > 1:
        # an odd one waits behind the sums
        pairs, odd = total.shape[1] // 2, slice(2 * (total.shape[1] // 2), None)
        sums, more = _sum(total[:, :pairs], total[:, pairs : 2 * pairs])
        lost = np.hstack([lost[:, :pairs] + lost[:, pairs : 2 * pairs] + more, lost[:, odd]])
        total = np.hstack([sums, total[:, odd]])
    return np.asarray(total[:, 0] + lost[:, 0])


def _sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a + b and what rounding has left out of it."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _product(a: _Split, b: _Split) -> tuple[FloatArray, FloatArray]:
    """Return a b and what rounding has left out of it."""
    product = a.whole * b.whole
    return product, ((a.high * b.high - product) + a.high * b.low + a.low * b.high) + a.low * b.low
