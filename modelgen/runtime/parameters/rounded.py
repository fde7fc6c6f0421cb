"""Numbers with the digits that their interval leaves them: 15150 +- 240."""

from __future__ import annotations

import math

# Exponents of ten between which a number is written out.
PLAIN = (-4, 6)
# Digits of a number without an interval, and the most that any interval leaves.
DIGITS, MOST_DIGITS = 4, 12


def with_interval(value: float, low: float, high: float) -> str:
    """Return a number with its interval, both to the interval's second digit.

    An interval that lies unevenly around the number (one half 1.5 times the other, or open at one end) is
    given by its ends.

    Examples
    --------
    >>> with_interval(15150.3, 14911.0, 15389.6)
    '15150 +- 240'
    >>> with_interval(9.87e-6, 9.85e-6, 9.89e-6)
    '(9.870 +- 0.020)e-06'
    >>> with_interval(2.0, 1.5, 4.0)
    '2.00 (1.50 to 4.0)'
    """
    # a bound, or rounding, may leave the number at the far side of an end
    below, above = max(value - low, 0.0), max(high - value, 0.0)
    half = 0.5 * (high - low)
    if not math.isfinite(value) or not half > 0.0:
        return f"{value:.{DIGITS}g}"
    if not math.isfinite(half):
        ends = (f"{end:.{DIGITS}g}" if math.isfinite(end) else "open" for end in (low, high))
        return f"{value:.{DIGITS}g} ({' to '.join(ends)})"
    exponent = _exponent(max(abs(value), half))
    scale = 0 if PLAIN[0] <= exponent < PLAIN[1] else exponent
    if 2.0 / 3.0 <= below / max(above, math.ulp(0.0)) <= 1.5:
        text = " +- ".join(_shown(number, half, exponent, scale) for number in (value, half))
        return text if not scale else f"({text})e{scale:+03d}"
    # every end to the second digit of its own distance
    near = min(below, above) or half
    shown = [
        _shown(*pair, exponent, scale)
        for pair in ((value, near), (low, below or half), (high, above or half))
    ]
    text = f"{shown[0]} ({shown[1]} to {shown[2]})"
    return text if not scale else f"({shown[0]}, {shown[1]} to {shown[2]})e{scale:+03d}"


def _shown(number: float, reach: float, exponent: int, scale: int) -> str:
    """Return a number to the second digit of `reach`, in units of ten to the power of `scale`."""
    place = max(_place(reach), exponent - MOST_DIGITS + 1) - scale
    return _to_place(number / 10.0**scale, place)


def _place(half: float) -> int:
    """Return the power of ten of the second digit; rounding may carry into a new first one."""
    exponent = _exponent(half)
    return exponent - 1 + (round(half / 10.0 ** (exponent - 1)) >= 100)


def _exponent(number: float) -> int:
    return math.floor(math.log10(number))


def _to_place(number: float, place: int) -> str:
    if place >= 0:
        number = round(number / 10.0**place) * 10.0**place
    return f"{number:.{max(0, -place)}f}"
