"""Numbers that can be calculated with: finite, and neither so large nor so small that their powers are not.

Covariances hold fourth powers of samples, and derivatives of high order powers of the sampling frequency; a
double ends at 1e308 and 1e-308. In SI units nothing of a machine comes near the limits here: they are the
width of the universe in picometres, and an inertia of a few atoms.
"""

from __future__ import annotations

import math
from numbers import Real

LARGEST, SMALLEST = 1e30, 1e-30  # magnitudes of SI values; zero is allowed
# of the largest sample of a channel: what a body at rest moves by rounding is to be read
FAINTEST = 1e-100
HIGHEST_HZ, LOWEST_HZ = 1e9, 1e-9  # from a sample a nanosecond to one in thirty years
LARGEST_COUNT = 2**31 - 1
REMEDY = f"give zero or a magnitude from {SMALLEST:g} to {LARGEST:g}; check the unit"
FACTOR_REMEDY = f"give a magnitude from {SMALLEST:g} to {LARGEST:g}"
FREQUENCY_REMEDY = f"give a frequency from {LOWEST_HZ:g} to {HIGHEST_HZ:g} Hz, finite and positive"


def is_usable(value: object) -> bool:
    """Return whether a number is zero, or finite and within the limits."""
    size = _size(value)
    return size == 0.0 or SMALLEST <= size <= LARGEST


def is_frequency(value: object) -> bool:
    """Return whether a number can be a frequency in Hz."""
    return isinstance(value, Real) and not value < 0 and LOWEST_HZ <= _size(value) <= HIGHEST_HZ


def shown_number(value: object) -> str:
    """Return a number in a message; Python refuses to print integers of thousands of digits."""
    try:
        return repr(value)
    except ValueError:
        return "an integer of thousands of digits"


def _size(value: object) -> float:
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return abs(float(value))
    except OverflowError:  # an integer beyond a double
        return math.inf
