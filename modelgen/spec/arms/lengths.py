"""Lengths: numbers of metres, texts of them, or multiples of a length with a name ("L2", "-L2/2")."""

from __future__ import annotations

import math
import re
from fractions import Fraction

from modelgen.magnitudes import REMEDY, is_usable
from modelgen.number_expression import LONGEST, Misread, exact_number
from modelgen.spec.arms.arm import Length
from modelgen.spec.words import identifier_problem, shown

EXAMPLE = 'for example 0.4318 (m), "431.8/1000", "L2" or "-L2/2"'
REMEDY_OF_TEXT = f"write a number (m) or a multiple of one name, {EXAMPLE}"
_MARKS = re.compile(r" *([-+*/]) *")
_NAMED = re.compile(
    r"(?P<sign>[+-]?)(?:(?P<times>[^A-Za-z*]+)\*)?(?P<name>(?!pi\b|\d)\w+)(?:/(?P<over>[^A-Za-z*/]+))?"
)


def read_length(value: object) -> Length:
    """Return a length that a number (m) or a text states.

    Raises
    ------
    Misread
        When it is neither, or cannot be calculated with.
    """
    if isinstance(value, str):
        named = _NAMED.fullmatch(_MARKS.sub(r"\1", value.strip())) if len(value) <= LONGEST else None
        length = _named(named) if named else Length(exact_number(value, REMEDY_OF_TEXT))
    elif isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        length = Length(Fraction(str(value)))
    else:
        raise Misread(f"is {shown(value)}, no length", f"write {EXAMPLE}")
    if not is_usable(length.factor):
        raise Misread(f"is {shown(value)}, a length that cannot be used", REMEDY)
    return Length(length.factor, length.name if length.factor else None)


def sum_of_lengths(one: Length, other: Length) -> Length | None:
    """Return the length of two shifts along the same axis; None where they have different names."""
    if one.name != other.name:
        return None
    factor = one.factor + other.factor
    return Length(factor, one.name if factor else None)


def _named(found: re.Match[str]) -> Length:
    problem = identifier_problem(found["name"])
    if problem:
        raise Misread(f"has a length named so: {problem[0]}", problem[1])
    factor = exact_number(found["times"] or "1")
    over = exact_number(found["over"] or "1")
    if not over:
        raise Misread("divides by zero", "divide by another number")
    return Length((-1 if found["sign"] == "-" else 1) * factor / over, found["name"])
