"""What lags, as deflections of damped springs: x of x + lag x' = v, of samples of v and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, exp

import numpy as np

from modelgen.array_types import FloatArray

# Derivatives of v beyond those of x that are looked at: with them v is a polynomial between samples.
FURTHER = 2
# Of the exponential within a sampling period; Gauss and Legendre's nodes are exact to 1e-13 for it.
NODES, FADED = 40, 40.0
# What the start of a stretch is off by has died away to 1e-11 after so many lags; longer ones than so many
# samples no estimate has.
LAGS_FELT, MOST_SAMPLES = 25.0, 1000.0


def lag_reach(lag: float, fs: float) -> int:
    """Return how many samples at `fs` in Hz a deflection remembers that lags by so many s."""
    return ceil(min(LAGS_FELT * abs(lag) * fs, MOST_SAMPLES))


def series(values: Sequence[FloatArray], lag: float) -> list[FloatArray]:
    """Return x and its derivatives, shape (N,) each: as many terms of 1 - lag s + ... as there are values."""
    found = []
    for order, value in enumerate(values):
        total = value
        for more in range(1, len(values) - order) if lag else ():
            total = total + (-lag) ** more * values[order + more]
        found.append(total)
    return found


def lagged(values: Sequence[FloatArray], lag: float, fs: float | None, exact: int) -> list[FloatArray]:
    """Return x and its derivatives, shape (N,) each, of v and its derivatives as far as they are known.

    At samples that follow each other (`fs` in Hz) the first `exact` of them are as `lagging` says, others by
    their `series`. What is not known of v beyond the last derivative bends it between two samples only.
    """
    found = series(values, lag)
    if fs is None or not lag:
        return found
    known = [*values, *[np.zeros_like(values[-1])] * FURTHER]
    found[:exact] = (lagging(known[order : order + FURTHER + 1], lag, fs) for order in range(exact))
    return found


def lagging(values: Sequence[FloatArray], lag: float, fs: float) -> FloatArray:
    """Return x, shape (N,), of v, v' and v'' at samples that follow each other.

    Between two samples v is the polynomial that has its value and both derivatives at the ends (Hermite), of
    which the exponential's integral is exact. At the first sample x is that of `series`.

    Parameters
    ----------
    values : sequence of array, shape (N,) each
    lag : float
        s. Where it is negative x is followed backward.
    fs : float
        Sampling frequency in Hz.
    """
    if not lag:
        return values[0]
    if lag < 0.0:
        mirrored = [(-1.0) ** order * value[::-1] for order, value in enumerate(values)]
        return lagging(mirrored, -lag, fs)[::-1]
    added = np.zeros(len(values[0]))
    added[:1] = series([value[:1] for value in values], lag)[0]
    for order, (before, behind) in enumerate(_weights(lag * fs)):
        scaled = values[order] * fs**-order
        added[1:] += before * scaled[:-1] + behind * scaled[1:]
    step, fade = 1, exp(-min(1.0 / (lag * fs), 700.0))
    while step < len(added) and fade > 0.0:  # sums over 1, 2, 4, ... samples
        added[step:] += fade * added[:-step]
        step, fade = 2 * step, fade * fade
    return added


@lru_cache(maxsize=64)
def _weights(lag: float) -> FloatArray:
    """Return what v, v' and v'' before and behind a sampling period of 1 add to x, shape (3, 2)."""
    # Quintic polynomials with one of (p(0), p'(0), p''(0), p(1), p'(1), p''(1)) 1 and the others 0
    ends = np.zeros((6, 6))
    for order in range(3):
        for power in range(order, 6):
            slope = float(np.prod(np.arange(power - order + 1, power + 1)))
            ends[order, power] = slope if power == order else 0.0
            ends[3 + order, power] = slope
    polynomials = np.linalg.inv(ends)
    nodes, shares = np.polynomial.legendre.leggauss(NODES)
    top = min(1.0 / lag, FADED)
    back = 0.5 * top * (nodes + 1.0)
    powers = (1.0 - lag * back)[:, None] ** np.arange(6)
    found = (0.5 * top * shares * np.exp(-back)) @ powers @ polynomials
    return np.asarray(found.reshape(2, 3).T)
