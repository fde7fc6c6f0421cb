"""Limits of a joint: angles in degrees or with their unit, speeds of rotations always with their unit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from modelgen.documents import Document
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.number_expression import PI, Misread, exact_number
from modelgen.spec.arms.angles import read_angle
from modelgen.spec.arms.arm import JointKind
from modelgen.spec.words import shown

_RATES = {"speed_limit": "s", "acceleration_limit": "s^2"}
_UNIT = re.compile(r"(?P<number>.*?) *(?P<unit>(?:deg|rad|m)/s(?:\^2|²)?)?", re.DOTALL)


@dataclass(frozen=True)
class Limits:
    """What the table of a joint says of its limits, in SI units, and (key, mistake) of what it cannot say."""

    values: Document
    mistakes: tuple[tuple[str, Misread], ...]


def read_limits(table: Document, kind: JointKind) -> Limits:
    """Return the limits in the table of a joint of this kind, but for those that cannot be read."""
    values: Document = {}
    mistakes: list[tuple[str, Misread]] = []
    for key, value in _given(table):
        try:
            values[key] = _value(key, value, kind)
        except Misread as found:
            mistakes.append((key, found))
    return Limits(values, tuple(mistakes))


def _given(table: Document) -> Iterator[tuple[str, Any]]:
    for key in ("position_limits", *_RATES, "force_limit"):
        value = table.get(key)
        if value is not None and not (isinstance(value, list) and None in value):
            yield key, value


def _value(key: str, value: Any, kind: JointKind) -> float | tuple[float, float]:
    if key == "position_limits":
        slides = kind == "prismatic"
        lower, upper = (float(_number(one)) if slides else read_angle(one).radians for one in value)
        if lower >= upper:
            raise Misread(f"has its lower limit {shown(value[0])} not below {shown(value[1])}", "swap them")
        return lower, upper
    size = float(exact_number(value) if isinstance(value, str) else value) if key == "force_limit" else None
    size = _rate(value, kind, _RATES[key]) if size is None else size
    if size <= 0:
        raise Misread(f"is {shown(value)}", "give a limit greater than 0; it holds in both directions")
    return size


def _rate(value: Any, kind: JointKind, per: str) -> float:
    parts = _UNIT.fullmatch(value.strip()) if isinstance(value, str) else None
    unit = (parts["unit"] or "").replace("²", "^2") if parts else ""
    number = _number(parts["number"] if parts else value)
    units = {f"m/{per}": Fraction(1)} | ({"": Fraction(1)} if kind == "prismatic" else {})
    if kind != "prismatic":
        units = {f"deg/{per}": PI / 180, f"rad/{per}": Fraction(1)}
    if unit not in units:
        what = f"is {shown(value)}, in {unit}" if unit else f"is {shown(value)}, without a unit"
        example = f'"0.5 m/{per}"' if kind == "prismatic" else f'"180 deg/{per}" or "3.14 rad/{per}"'
        raise Misread(what, f"write for example {example}")
    return float(number * units[unit])


def _number(value: Any) -> Fraction:
    number = exact_number(value) if isinstance(value, str) else None
    if number is None:
        number = Fraction(str(value)) if is_usable(value) else None
    if number is None or not is_usable(number):
        raise Misread(f"is {shown(value)}, which cannot be used", REMEDY)
    return number
