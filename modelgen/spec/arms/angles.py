"""Angles that are fixed: texts and numbers -> cosine and sine as fractions on the unit circle."""

from __future__ import annotations

import math
import re
from fractions import Fraction

from modelgen.magnitudes import is_usable
from modelgen.number_expression import PI, Misread, exact_number
from modelgen.spec.arms.arm import Angle
from modelgen.spec.words import shown

#: What is nearer to a multiple of 90 degrees is that multiple: 1.5708 rad is 3.7e-6 off pi/2, and a sixth
#: decimal of a description is no measurement.
RIGHT_ANGLE_RAD = 1e-5
#: Farther than that, but near enough to ask whether a right angle was meant (1.57 rad).
NEARLY_RIGHT_RAD = 2e-3

EXAMPLE = 'for example 90 (degrees), "pi/2" or "0.35 rad"'
_UNIT = re.compile(r"(?P<number>.*?) *(?P<unit>deg|°|rad)?", re.DOTALL)
_PI = re.compile(r"pi|π")
_RIGHT = ((Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)), (Fraction(-1), Fraction(0)))
_QUARTERS = (*_RIGHT, (Fraction(0), Fraction(-1)))
#: Multiples of pi/12 that people write as decimals.
_FAMILIAR = (2, 3, 4, 6, 8, 9, 10, 12, 18, 24)


def read_angle(value: object) -> Angle:
    """Return an angle that a number (degrees) or a text ("pi/2", "0.35 rad", "20 deg") states.

    Raises
    ------
    Misread
        When it is neither, cannot be calculated with, or is a number of degrees that looks like radians.
    """
    if isinstance(value, str):
        parts = _UNIT.fullmatch(value.strip())
        assert parts is not None
        number = exact_number(parts["number"], f"write an angle, {EXAMPLE}")
        unit = parts["unit"] or ("rad" if _PI.search(value) else "deg")
        written = parts["unit"] is not None or unit == "rad"
    elif isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        number, unit, written = Fraction(str(value)), "deg", False
    else:
        raise Misread(f"is {shown(value)}, no angle", f"write {EXAMPLE}")
    if not is_usable(number) or abs(number) > 10**6:
        raise Misread(f"is {shown(value)}, an angle that cannot be used", "give one within a few turns")
    if not written:
        _refuse_radians(number, shown(value))
    return angle_of(number * 180 / PI if unit == "rad" else number)


def angle_of(degrees: Fraction) -> Angle:
    """Return the angle of so many degrees, exact for multiples of 90; see `RIGHT_ANGLE_RAD`."""
    radians = math.radians(float(degrees))
    quarters = round(degrees / 90)
    rest = math.radians(float(degrees - 90 * quarters))
    cosine, sine = Fraction(1), Fraction(0)
    if abs(rest) > RIGHT_ANGLE_RAD:
        t = _nearest_fraction(math.tan(0.5 * rest))
        cosine, sine = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    c, s = _QUARTERS[quarters % 4]
    return Angle(c * cosine - s * sine, s * cosine + c * sine, radians)


def sum_of_angles(one: Angle, other: Angle) -> Angle:
    """Return the angle of two turns about the same axis, one after the other."""
    cosine = one.cosine * other.cosine - one.sine * other.sine
    sine = one.sine * other.cosine + one.cosine * other.sine
    return Angle(cosine, sine, one.radians + other.radians)


def reversed_angle(angle: Angle) -> Angle:
    """Return the angle that undoes this one."""
    return Angle(angle.cosine, -angle.sine, -angle.radians)


def nearly_right(angle: Angle) -> bool:
    """Return whether an angle is so near to a multiple of 90 degrees that it may have been meant."""
    rest = math.remainder(angle.radians, 0.5 * math.pi)
    return bool(angle.cosine and angle.sine) and abs(rest) < NEARLY_RIGHT_RAD


def _nearest_fraction(value: float) -> Fraction:
    """Return a short fraction that is as near as the last digit of a double."""
    exact = Fraction(value)
    for digits in range(1, 18):
        short = exact.limit_denominator(10**digits)
        if abs(short - exact) <= Fraction(1, 10**17):
            return short
    return exact


def _refuse_radians(degrees: Fraction, written: str) -> None:
    """Refuse 1.5708 without a unit: nobody builds an arm with an angle of pi/2 degrees."""
    for twelfths in _FAMILIAR:
        size = abs(degrees)
        if size.denominator > 1 and abs(float(size) - twelfths * math.pi / 12) < NEARLY_RIGHT_RAD:
            sign, meant = "-" if degrees < 0 else "", Fraction(twelfths, 12)
            times = f"{meant.numerator}*" if meant.numerator > 1 else ""
            share = f"/{meant.denominator}" if meant.denominator > 1 else ""
            right = f'"{sign}{times}pi{share}"'
            what = f"is {written}, which would be degrees, but looks like {right[1:-1]} rad"
            raise Misread(
                what, f'write {right} or {sign}{15 * twelfths}; or name the unit, "{float(degrees):g} deg"'
            )
