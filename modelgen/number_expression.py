"""Numbers as people write them: "2*pi/0.01" -> an exact fraction. A grammar of its own; nothing is executed.

sum     = product, then any of + product, - product
product = factor, then any of * factor, / factor
factor  = + factor | - factor | number | pi | ( sum )
"""

from __future__ import annotations

import re
from fractions import Fraction

# The shortest fraction that is pi as a double. A relation that pi does not have would need whole numbers of
# eight digits in a spec: what is exact (ranks, cancelling around a loop) comes out as with pi itself.
PI = Fraction(245_850_922, 78_256_779)
LONGEST, DEEPEST = 200, 32
EXAMPLE = 'for example "2*pi/0.01"'
GRAMMAR = f"write numbers, pi, + - * / and brackets, {EXAMPLE}"

_TOKEN = re.compile(
    r" *(?:(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3}(?![0-9]))?(?![A-Za-z0-9_.]))"
    r"|(?P<mark>[-+*/()])|(?P<pi>(?:pi|π)(?![A-Za-z0-9_])))"
)
_WORD = re.compile(r"[A-Za-z0-9_.]+|.", re.DOTALL)
_MEANT = {
    "^": "write a power as a product, 10*10",
    "**": "write a power as a product, 10*10",
    ":": "write a gear of 20:1 as 20/1",
    ",": "write a decimal point",
    "×": "write *",
    "·": "write *",
    "÷": "write /",
    "−": "write the minus of the keyboard, -",
}


class Misread(ValueError):
    """A text that is no number: what is wrong with it, and the remedy."""

    def __init__(self, what: str, remedy: str = GRAMMAR) -> None:
        super().__init__(what, remedy)
        self.what, self.remedy = what, remedy


def exact_number(text: str, remedy: str = GRAMMAR) -> Fraction:
    """Return the value of a text of numbers, pi, + - * / and brackets.

    Decimals are what was written ("0.1" is 1/10); pi is `PI`. What is of another form has this remedy.

    Raises
    ------
    Misread
        When the text is not of this form, divides by zero, or is too long; it says at which character.
    """
    if len(text) > LONGEST:
        raise Misread(f"has {len(text)} characters", f"shorten it to {LONGEST}, or write the number itself")
    return _Reading(text, remedy).all()


class _Reading:
    """Recursive descent over one text; `_at` is where the next token begins."""

    def __init__(self, text: str, remedy: str) -> None:
        self._text, self._remedy = text.rstrip(" "), remedy
        self._at = self._depth = 0

    def all(self) -> Fraction:
        value = self._sum()
        if self._at < len(self._text):
            self._refuse()
        return value

    def _sum(self) -> Fraction:
        value = self._product()
        while mark := self._mark("+-"):
            other = self._product()
            value = value + other if mark == "+" else value - other
        return value

    def _product(self) -> Fraction:
        value = self._factor()
        while mark := self._mark("*/"):
            start = self._next()
            other = self._factor()
            if mark == "/" and not other:
                raise Misread(f"divides by zero at character {start + 1}", "divide by another number")
            value = value * other if mark == "*" else value / other
        return value

    def _factor(self) -> Fraction:
        opened = self._next()
        self._depth += 1
        if self._depth > DEEPEST:
            raise Misread(f"has more than {DEEPEST} brackets or signs in one another", "write it shorter")
        if sign := self._mark("+-"):
            value = self._factor()
            value = value if sign == "+" else -value
        elif self._mark("("):
            value = self._sum()
            if not self._mark(")"):
                if self._at < len(self._text):
                    self._refuse()
                raise Misread(f"has an open bracket at character {opened + 1}", "close it with )")
        else:
            value = self._number()
        self._depth -= 1
        return value

    def _number(self) -> Fraction:
        found = _TOKEN.match(self._text, self._at)
        if found is None or found["mark"]:
            self._refuse()
        assert found is not None
        self._at = found.end()
        return PI if found["pi"] else Fraction(found["number"])

    def _mark(self, marks: str) -> str:
        """Return the next token and pass it if it is one of these marks; else an empty text."""
        found = _TOKEN.match(self._text, self._at)
        if found is None or not found["mark"] or found["mark"] not in marks:
            return ""
        if found["mark"] == "*" and self._text[found.end() : found.end() + 1] == "*":
            raise Misread(f"has ** at character {found.start('mark') + 1}", _MEANT["**"])
        self._at = found.end()
        return found["mark"]

    def _next(self) -> int:
        return len(self._text) - len(self._text[self._at :].lstrip(" "))

    def _refuse(self) -> None:
        at = self._next()
        if at >= len(self._text):
            what = "ends where a number should stand" if self._text else "is empty"
            raise Misread(what, self._remedy)
        word = _WORD.match(self._text, at)
        assert word is not None
        shown = word[0] if len(word[0]) <= 20 else f"{word[0][:17]}..."
        raise Misread(
            f"cannot be read from {shown!r} at character {at + 1} on", _MEANT.get(word[0], self._remedy)
        )
