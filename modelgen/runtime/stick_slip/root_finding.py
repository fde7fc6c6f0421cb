"""Where a linear function of an exact linear flow first turns negative.

The flow z(u) = exp(u M) z(0), 0 <= u <= 1, is a power series in u that reaches double precision after a few
terms while the norm of M is small. A crossing is then a root of a polynomial: no further matrix exponential.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray

# 2^24 / 24! = 3e-17: up to this norm of M, what the series leaves out is below rounding
TERMS = 24
LARGEST_NORM = 2.0
GRID = np.linspace(0.0, 1.0, 9)
POWERS = GRID[:, None] ** np.arange(TERMS)


def power_series(M: FloatArray, z: FloatArray) -> FloatArray:
    """Return the coefficients of exp(u M) z in u, lowest order first, shape (TERMS, len(z))."""
    series = np.empty((TERMS, z.size))
    series[0] = z
    for order in range(1, TERMS):
        series[order] = M @ series[order - 1] / order
    return series


def value_at(series: FloatArray, u: float) -> FloatArray:
    """Return the value of the power series at u, shape (len(z),)."""
    value: FloatArray = u ** np.arange(len(series)) @ series
    return value


def when_negative(polynomial: FloatArray) -> float | None:
    """Return the first u in [0, 1] after which a polynomial is negative, or None.

    The coefficients have shape (orders,), lowest order first.

    Its value at 0 should not be negative. Where it is zero, or negative by rounding, this is a crossing only
    if the next non-zero coefficient is negative.
    """
    if polynomial[0] > np.abs(polynomial[1:]).sum():
        return None
    p = polynomial if polynomial[0] > 0.0 else np.trim_zeros(polynomial[1:], "f")
    if p.size == 0:
        return None
    return _first_root(p) if p[0] > 0.0 else 0.0


def _first_root(p: FloatArray) -> float | None:
    """Return the first root in (0, 1] of a polynomial that is positive at 0, or None."""
    slope = p[1:] * np.arange(1, p.size)
    values, slopes = POWERS[:, : p.size] @ p, POWERS[:, : slope.size] @ slope
    for i in range(GRID.size - 1):
        low, high = float(GRID[i]), float(GRID[i + 1])
        if values[i + 1] < 0.0:
            return _root(p, low, high)
        if slopes[i] < 0.0 < slopes[i + 1]:
            lowest = _root(slope, low, high)
            if _horner(p[::-1].tolist(), lowest) < 0.0:
                return _root(p, low, lowest)
    return None


def _root(p: FloatArray, low: float, high: float) -> float:
    """Return the root of a polynomial between two values of u at which its signs differ."""
    from scipy.optimize import brentq

    backwards = p[::-1].tolist()
    return float(brentq(lambda u: _horner(backwards, u), low, high, xtol=1e-16, rtol=1e-15))


def _horner(backwards: list[float], u: float) -> float:
    """Return the value at u; in plain floats, many times faster than NumPy on a few coefficients."""
    total = 0.0
    for coefficient in backwards:
        total = total * u + coefficient
    return total
