"""Where a linear function of an exact linear flow first turns negative.

The flow z(u) = exp(u M) z(0), 0 <= u <= 1, is a power series in u that reaches double precision after a few
terms while the norm of M is small. A crossing is then a root of a polynomial: no further matrix exponential.
Roots are found in plain loops, which numba can compile; on a few coefficients they are faster than NumPy.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modelgen.array_types import FloatArray

# 2^24 / 24! = 3e-17: up to this norm of M, what the series leaves out is below rounding
TERMS = 24
LARGEST_NORM = 2.0
# Of [0, 1]: within each a polynomial is supposed to have one lowest point at most.
INTERVALS = 8


def power_series(M: FloatArray, z: FloatArray) -> FloatArray:
    """Return coefficients of exp(u M) z in u, in the unit of z, lowest order first, shape (TERMS, len(z))."""
    series = np.empty((TERMS, z.size))
    series[0] = z
    for order in range(1, TERMS):
        series[order] = M @ series[order - 1] / order
    return series


def value_at(series: FloatArray, u: float) -> FloatArray:
    """Return the value of the power series at u, in its unit, shape (len(z),)."""
    value: FloatArray = u ** np.arange(len(series)) @ series
    return value


def horner(p: Any, u: float) -> float:
    """Return the value at u of a polynomial, lowest order first."""
    total = 0.0
    for i in range(len(p) - 1, -1, -1):
        total = total * u + p[i]
    return total


def root_between(p: Any, low: float, high: float) -> float:
    """Return the root of a polynomial between two values of u where its signs differ: Newton in brackets."""
    falling = horner(p, high) < 0.0  # the root may be at `low`
    u = 0.5 * (low + high)
    for _ in range(100):
        value, slope = 0.0, 0.0
        for i in range(len(p) - 1, -1, -1):
            slope = slope * u + value
            value = value * u + p[i]
        if value == 0.0:
            return u
        if (value > 0.0) == falling:
            low = u
        else:
            high = u
        after = u - value / slope if slope != 0.0 else low
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - u) <= 1e-16:
            return after
        u = after
    return u


def first_root(p: Any) -> float:
    """Return the first root in (0, 1] of a polynomial that is positive at 0, or 2."""
    slope = np.empty(len(p) - 1)
    for i in range(len(slope)):
        slope[i] = (i + 1) * p[i + 1]
    for i in range(INTERVALS):
        low, high = i / INTERVALS, (i + 1) / INTERVALS
        if horner(p, high) < 0.0:
            return root_between(p, low, high)
        if horner(slope, low) < 0.0 and horner(slope, high) > 0.0:
            lowest = root_between(slope, low, high)
            if horner(p, lowest) < 0.0:
                return root_between(p, low, lowest)
    return 2.0


def when_negative(p: Any) -> float:
    """Return the first u in [0, 1] after which a polynomial is negative, or 2.

    The coefficients have shape (orders,), lowest order first.

    Its value at 0 should not be negative. Where it is zero, or negative by rounding, this is a crossing only
    if the next non-zero coefficient is negative.
    """
    rest = 0.0
    for i in range(1, len(p)):
        rest += abs(p[i])
    if p[0] > rest:
        return 2.0
    first = 0
    if p[0] <= 0.0:
        first = 1
        while first < len(p) and p[first] == 0.0:
            first += 1
        if first == len(p):
            return 2.0
        if p[first] < 0.0:
            return 0.0
    return first_root(p[first:])
