"""Numbers in the attributes of a URDF; every one that is none is noted with its line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from modelgen.errors import Problem
from modelgen.magnitudes import LARGEST, SMALLEST
from modelgen.spec.arms.urdf.xml_tree import Element
from modelgen.spec.words import shown

#: What is shorter comes from the rounding of a drawing, not from an arm (m).
NO_LENGTH = Fraction(1, 10**9)
_NUMBER = re.compile(r"[+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,3})?")
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Attributes:
    """A file's name, and the problems that were found in its attributes so far."""

    source: str
    problems: list[Problem] = field(default_factory=list)

    def place(self, element: Element, of: str = "") -> str:
        """Return where an element is, for messages."""
        return f"{self.source}: line {element.line}{f': {of}' if of else ''}"

    def report(self, element: Element, of: str, what: str, remedy: str) -> None:
        """Note a mistake."""
        self.problems.append(Problem(self.place(element, of), what, remedy))

    def numbers(
        self, element: Element | None, key: str, default: Sequence[Fraction], of: str
    ) -> tuple[Fraction, ...]:
        """Return the numbers in an attribute, as many as the default has, which is for what is not there."""
        text = None if element is None else element.attributes.get(key)
        if element is None or text is None:
            return tuple(default)
        words = text.split() if len(text) <= 1000 else [text]
        values = [_number(word) for word in words]
        read = [value for value in values if value is not None]
        if len(read) < len(values) or len(values) != len(default):
            count = f"{len(default)} numbers" if len(default) > 1 else "a number"
            what = f"has {key} = {shown(text)}, which is not {count} that can be calculated with"
            remedy = f"correct {key}"
            if "$" in text:
                remedy = "expand the macros first: xacro robot.xacro > robot.urdf"
            self.report(element, of, what, remedy)
            return tuple(default)
        return tuple(read)

    def number(self, element: Element | None, key: str, of: str) -> Fraction | None:
        """Return the number in an attribute; None where there is none, or it cannot be read."""
        if element is None or key not in element.attributes:
            return None
        before = len(self.problems)
        (value,) = self.numbers(element, key, (_ZERO,), of)
        return value if len(self.problems) == before else None

    def never_negative(self, element: Element | None, key: str, of: str) -> Fraction:
        """Return the number in an attribute, zero where there is none; a negative one is a mistake."""
        value = self.number(element, key, of) or _ZERO
        if element is not None and value < 0:
            self.report(element, of, f"has {key} = {float(value):g}, which is negative", f"correct {key}")
        return value


def without_dust(lengths: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return lengths (m) with those of rounding as zero."""
    return tuple(value if abs(value) >= NO_LENGTH else _ZERO for value in lengths)


def _number(word: str) -> Fraction | None:
    if not _NUMBER.fullmatch(word):
        return None
    value = Fraction(word)
    if abs(value) > LARGEST:
        return None
    return value if abs(value) >= SMALLEST else _ZERO
