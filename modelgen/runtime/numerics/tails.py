"""Tails of the normal and the chi-square distribution, and what is likely of a size, in closed form.

`scipy.stats` has them as well, but its import takes longer than the identification of a short record.
"""

from __future__ import annotations

from functools import lru_cache
from math import erfc, exp, lgamma, log, sqrt
from statistics import NormalDist
from sys import float_info


def normal_tail(x: float) -> float:
    """Return the probability of a standard normal variable above x."""
    return 0.5 * erfc(x / sqrt(2.0))


def normal_beyond(p: float) -> float:
    """Return what a standard normal variable exceeds with the probability p, 0 < p < 1."""
    return -NormalDist().inv_cdf(p)


def chi_square_tail(x: float, degrees: int) -> float:
    """Return the probability of a chi-square variable of so many degrees of freedom above x.

    The sums are finite for whole degrees of freedom (Abramowitz and Stegun 26.4.4, 26.4.5).
    """
    if x <= 0.0:
        return 1.0
    half, odd = 0.5 * x, degrees % 2
    total = erfc(sqrt(half)) if odd else 0.0
    for k in range((degrees + odd) // 2 - odd):
        power = k + 0.5 * odd
        total += exp(power * log(half) - half - lgamma(power + 1.0))
    return min(total, 1.0)


@lru_cache(maxsize=64)  # rows are tested with the same few
def chi_square_beyond(p: float, degrees: int) -> float:
    """Return what a chi-square variable exceeds with the probability p, 0 < p < 1; by halving."""
    low, high = 0.0, 2.0 * degrees + 10.0
    while chi_square_tail(high, degrees) > p:
        low, high = high, 2.0 * high
    while low < (middle := 0.5 * (low + high)) < high:
        if chi_square_tail(middle, degrees) > p:
            low = middle
        else:
            high = middle
    return high


def likely_square(size: float, std: float, doubtful: bool = True) -> float:
    """Return the mean square of a number of about 1, of which an estimate tells a size, +- std.

    Beforehand it is normal with the standard deviation 1; what is `doubtful` is as likely not there at all
    (Mitchell and Beauchamp 1988).
    """
    std = max(abs(std), float_info.epsilon)
    share = 1.0 / (1.0 + std**2)
    odds = exp(-0.5 * share * (size / std) ** 2) * sqrt(1.0 + 1.0 / std**2)
    return (share**2 * size**2 + 1.0 - share) / (1.0 + odds * doubtful)
