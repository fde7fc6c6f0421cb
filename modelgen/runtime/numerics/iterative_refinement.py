"""Iterative refinement of a least-squares solution, with its residuals in twice the working precision.

Where the residual is large and the columns nearly dependent, rounding in the residual alone costs twice as
many digits as the columns do. Solving for the residual together with the solution (the augmented system of
Björck, BIT 7, 1967, 257-278) wins them back. Products and sums keep what they round off (Dekker, Numer. Math.
18, 1971), so that no wider type is needed, which not every machine has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.regressor import Regressor, regressor

Parts = Sequence[tuple[FloatArray | Regressor, FloatArray]]

# Pieces that come to so many numbers are worked on as one: steps on short ones cost as much as on long ones.
ONE_PIECE = 1 << 16
SPLITTER = 2.0**27 + 1.0  # splits 53 bits into two halves whose products are exact
ROUNDS = 2


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
            defect = _defect(of.samples, Y, of.own(x), residual)
            gradient += of.spread(of.samples.T @ defect + _projection(of.samples, residual))
            defects.append(defect)
        step = inverse @ gradient
        x = x + step
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


def _defect(W: FloatArray, Y: FloatArray, x: FloatArray, residual: FloatArray) -> FloatArray:
    """Return Y - residual - W x, shape (r,)."""
    total, lost = _sum(Y, -residual)
    for column, value in zip(W.T, x, strict=True):
        product, below = _product(column, np.full(len(column), -value))
        total, more = _sum(total, product)
        lost = lost + (below + more)
    return total + lost


def _projection(W: FloatArray, residual: FloatArray) -> FloatArray:
    """Return W^T residual, shape (c,), adding up by halves."""
    if not len(residual):  # every sample of this piece is masked
        return np.zeros(W.shape[1])
    total, lost = _product(W, residual[:, None])
    while len(total) > 1:
        odd = total[-1:] if len(total) % 2 else total[:0]
        odd_lost = lost[-1:] if len(total) % 2 else lost[:0]
        pairs = len(total) // 2
        sums, more = _sum(total[:pairs], total[pairs : 2 * pairs])
        lost = np.concatenate([lost[:pairs] + lost[pairs : 2 * pairs] + more, odd_lost])
        total = np.concatenate([sums, odd])
    return np.asarray(total[0] + lost[0])


def _sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a + b and what rounding has left out of it."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a b and what rounding has left out of it."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _halves(a), _halves(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _halves(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    shifted = SPLITTER * a
    high = shifted - (shifted - a)
    return high, a - high
