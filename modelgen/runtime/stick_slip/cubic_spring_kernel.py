"""The power series of a chain's motion within a step, cubic springs included; written for a compiler.

Without springs z' = M z has the coefficients M^k z / k!. With springs every coefficient follows from the
lower ones as well: those of a product of two series are sums over products (Cauchy). The series is then as
exact as the linear one, but converges so far only; where 24 terms do not do, the step is taken in parts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# as in crossing.py: 2^24 / 24! is below rounding
TERMS = 24
# What the terms left out may amount to, relative to the motion within the step.
TRUNCATION = 1e-17
# A part of a step that the series can follow, as a share of where its last terms become negligible.
CAUTION = 0.9
MOST_SHRINKS = 50
# Fewer terms than this may not show a motion that only begins.
FEWEST_TERMS = 6
# Behind the states, z holds the input, its slope, and 1.
INPUTS = 3


def dot(a: Any, b: Any) -> float:
    """Return the inner product of two vectors."""
    total = 0.0
    for i in range(len(b)):
        total += a[i] * b[i]
    return total


def product_term(a: Any, b: Any, order: int) -> float:
    """Return one coefficient of the product of two power series."""
    total = 0.0
    for i in range(order + 1):
        total += a[i] * b[order - i]
    return total


def expand(
    z: Any, M: Any, deflections: Any, pushes: Any, span: float, series: Any, cubes: Any
) -> tuple[float, int]:
    """Fill the series of z over so many steps, and of the cubed deflections.

    Return the share that they cover, and how many terms: further ones would be lost in rounding.

    `series` has shape (TERMS, len(z)), `cubes` (springs, TERMS); `deflections` and `pushes`, shape (springs,
    len(z)), belong to the mode: a held body is not pushed. The series are scaled to the share returned.
    """
    size, springs, last = len(z), len(deflections), TERMS - 1
    # along a chain a force may take a term a state to be felt
    fewest = FEWEST_TERMS + (0 if springs > 0 else size - INPUTS)
    stretch, square = np.zeros((springs, TERMS)), np.zeros((springs, TERMS))
    for i in range(size):
        series[0, i] = z[i]
    for order in range(TERMS):
        for s in range(springs):
            stretch[s, order] = dot(deflections[s], series[order])
            square[s, order] = product_term(stretch[s], stretch[s], order)
            cubes[s, order] = product_term(square[s], stretch[s], order)
        if order == last:
            break
        for i in range(size):
            rate = dot(M[i], series[order])
            for s in range(springs):
                rate += pushes[s, i] * cubes[s, order]
            series[order + 1, i] = rate * span / (order + 1)
        if order + 1 >= fewest and is_told(series, order + 1):
            last = order + 1
    if springs == 0 or last < TERMS - 1:
        return 1.0, last + 1
    covered = 1.0
    for _ in range(MOST_SHRINKS):
        share = reach(series, last)
        if share == 1.0:
            break
        # what counts as the motion is less now, so look again
        shrink(series, cubes, share)
        covered *= share
    return covered, TERMS


def is_told(series: Any, last: int) -> bool:
    """Return whether the last two terms are negligible, compared with the motion of each state."""
    for i in range(series.shape[1] - INPUTS):
        moved = 0.0
        for order in range(1, last + 1):
            moved = max(moved, abs(series[order, i]))
        # what has overflowed is no number, and ends the step in what is not finite
        for order in range(last - 1, last + 1):
            if TRUNCATION * moved < abs(series[order, i]) < np.inf:
                return False
    return True


def reach(series: Any, last: int) -> float:
    """Return up to which u <= 1 the last two terms stay negligible compared with the motion of each state."""
    share = 1.0
    for i in range(series.shape[1] - INPUTS):
        moved = 0.0
        for order in range(1, last + 1):
            moved = max(moved, abs(series[order, i]))
        for order in range(last - 1, last + 1):
            term = abs(series[order, i])
            # what has overflowed is no number, and ends the step in what is not finite
            if term > TRUNCATION * moved and term < np.inf:
                share = min(share, CAUTION * (TRUNCATION * moved / term) ** (1.0 / order))
    return share


def shrink(series: Any, cubes: Any, share: float) -> None:
    """Scale power series in u to a variable that is 1 at u = share."""
    scale = 1.0
    for order in range(1, TERMS):
        scale *= share
        for i in range(series.shape[1]):
            series[order, i] *= scale
        for s in range(len(cubes)):
            cubes[s, order] *= scale
