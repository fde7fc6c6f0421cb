"""Whether a text is one that the generator could have written, line by line (`skeleton`).

A text that passes holds the fixed lines of the template, and between them lines of a few small forms over
names that its own literals declare. No name has to be resolved: what is not in a form is refused. Importing
such a text computes nothing; its functions do arithmetic on arrays of the sizes that it declares, and end.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from modelgen.errors import Problem
from modelgen.generated_module.literals import (
    LONGEST_LITERAL,
    Declared,
    declared_by,
    declared_by_arm,
    literal_value,
)
from modelgen.generated_module.skeleton import BODY, HEAD, LITERAL, SLOTS
from modelgen.generated_module.skeleton_of_arms import BODY as BODY_OF_ARMS
from modelgen.generated_module.skeleton_of_arms import HEAD as HEAD_OF_ARMS

REMEDY = "generate the module again (modelgen generate)"
SMALLER = "describe the machine with fewer bodies"
LARGEST_ARRAY = 10_000_000  # numbers a sample; a thousand bodies, all of them sensed, have six millions
MOST_LINES = 50_000  # of code, five kilobytes each to compile; a thousand bodies have 27,000
LONGEST_SUM = 2000  # terms; the compiler of Python 3.11 goes to 3000

_SLOT = re.compile(r"<([A-Za-z0-9_ ]+)>")
_REFERENCE = re.compile(r'([sfp])\["([^"]+)"\]')
_KINDS = {"s": "signal", "f": "feature", "p": "parameter"}


class Deviation(Exception):
    """Where a text leaves the skeleton (in characters), what is wrong there, and the remedy."""

    def __init__(self, at: int, what: str, remedy: str = REMEDY) -> None:
        self.at, self.what, self.remedy = at, what, remedy


class Match(NamedTuple):
    """A line of a text in one of the skeleton's forms: its place, and (slot, text) pairs."""

    start: int
    end: int
    values: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class SkeletonLine:
    """One line of the skeleton, or two that belong together: fixed parts, and names of slots between them."""

    shown: str
    parts: tuple[str, ...]

    def match(self, text: str, at: int) -> Match | None:
        """Return the line that begins at `at` if it has this form."""
        start, values = at, []
        for place, part in enumerate(self.parts):
            if place % 2:
                found = _pattern(part).match(text, at)
                if found is None:
                    return None
                values.append((part, found.group()))
                at = found.end()
            elif text.startswith(part, at):
                at += len(part)
            else:
                return None
        return Match(start, at, tuple(values))


@dataclass(frozen=True)
class Place:
    """Where one of some lines stands: once (""), once or not at all ("?"), or any number of times ("*")."""

    mark: str
    lines: tuple[SkeletonLine, ...]

    def match(self, text: str, at: int) -> Match | None:
        """Return the line that begins at `at` if it has one of the forms."""
        return next((found for line in self.lines if (found := line.match(text, at))), None)


def first_deviation(text: str) -> Problem | None:
    """Return the first thing in a text that the generator would not have written; `where` is its line."""
    arm = "\nARM = " in text
    head, body = (HEAD_OF_ARMS, BODY_OF_ARMS) if arm else (HEAD, BODY)
    try:
        at, literals = _follow(_places(head), text, 0, Declared({}, {}))
        if text.count("\n", at) > MOST_LINES:
            raise Deviation(at, f"begins more than {MOST_LINES} lines of code", SMALLER)
        declared = declared_by_arm(literals) if arm else declared_by(literals)
        for variants in body:
            at = _follow_one(variants, text, at, declared)
        if at != len(text):
            raise Deviation(at, f"{_found(text, at)} where modelgen writes nothing more")
    except Deviation as found:
        return Problem(f"line {text[: found.at].count(chr(10)) + 1}", found.what, found.remedy)
    return None


def _follow_one(variants: tuple[str, ...], text: str, at: int, declared: Declared) -> int:
    """Return where one of some blocks ends; complain about the one that comes furthest."""
    deviations = []
    for block in variants:
        try:
            return _follow(_places(block), text, at, declared)[0]
        except Deviation as found:
            deviations.append(found)
    raise max(deviations, key=lambda found: found.at)


def _follow(
    block: tuple[Place, ...], text: str, at: int, declared: Declared
) -> tuple[int, dict[str, object]]:
    """Return where the block that begins at `at` ends, and the literals in it."""
    literals: dict[str, object] = {}
    wanted: list[str] = []
    for place in block:
        wanted += [line.shown for line in place.lines]
        match = place.match(text, at)
        if match is None and not place.mark:
            raise Deviation(at, f"{_found(text, at)} where modelgen writes {_forms(wanted)}")
        while match:
            literals |= _checked(match, declared)
            at, wanted = match.end, wanted[-len(place.lines) :] if place.mark == "*" else []
            match = place.match(text, at) if place.mark == "*" else None
    return at, literals


@cache
def _places(block: str) -> tuple[Place, ...]:
    """Read a block of the skeleton."""
    found: list[Place] = []
    for line in block.splitlines():
        mark, source = line[:1].strip(), line[2:]
        last = found[-1].lines if found else ()
        if mark == "+":
            found[-1] = Place("*", (*last[:-1], _line(f"{last[-1].shown}\n{source}")))
        elif mark == "*" and found[-1].mark == "*":
            found[-1] = Place("*", (*last, _line(source)))
        else:
            found.append(Place(mark, (_line(source),)))
    return tuple(found)


def _line(source: str) -> SkeletonLine:
    return SkeletonLine(source, tuple(_SLOT.split(f"{source}\n")))


@cache
def _pattern(slot: str) -> re.Pattern[str]:
    return re.compile(SLOTS.get(slot, LITERAL))


def _checked(match: Match, declared: Declared) -> dict[str, object]:
    """Return the literals in a line of the right form; refuse numbers and names that are declared nowhere."""
    literals: dict[str, object] = {}
    sizes = [1]
    for slot, source in match.values:
        if slot.isupper():
            literals[slot] = _literal(source, match.start)
        elif slot in declared.counts:
            if int(source) >= declared.counts[slot]:
                raise Deviation(match.start, f"uses {slot} {source} of {declared.counts[slot]}, from 0")
        elif slot[:-1] in declared.counts:
            sizes.append(int(source))
            if sizes[-1] != declared.counts[slot[:-1]]:
                raise Deviation(match.start, f"has {source} {slot}, not {declared.counts[slot[:-1]]}")
        elif slot != "text":
            _check_names(slot, source, match.start, declared)
    if math.prod(sizes) > LARGEST_ARRAY:
        raise Deviation(match.start, f"makes an array of more than {LARGEST_ARRAY} numbers", SMALLER)
    return literals


def _check_names(slot: str, source: str, at: int, declared: Declared) -> None:
    """Refuse a name that is declared nowhere, and a sum that no compiler takes."""
    names = [(_KINDS[letter], name) for letter, name in _REFERENCE.findall(source)]
    if slot in declared.names:
        names.append((slot, source))
    for kind, name in names:
        if name not in declared.names[kind]:
            raise Deviation(at, f"names the {kind} {name!r}, which the module does not declare")
    if source.count(" + ") + source.count(" - ") > LONGEST_SUM:
        raise Deviation(at, f"holds a sum of more than {LONGEST_SUM} terms", SMALLER)


def _literal(source: str, at: int) -> object:
    if source.count(",") > LONGEST_LITERAL:
        raise Deviation(at, f"holds a literal of more than {LONGEST_LITERAL} entries", SMALLER)
    try:
        return literal_value(source)
    except ValueError as error:
        raise Deviation(at, str(error)) from error


def _found(text: str, at: int) -> str:
    """Return in words what stands at a place of a text."""
    if at == len(text):
        return "ends"
    line = text[at : at + 60].partition("\n")[0].strip()
    return f"holds {line!a}" if line else "has an empty line"


def _forms(wanted: list[str]) -> str:
    """Return in words the lines of the skeleton that may stand in one place: the first and the last."""
    lines = [_SLOT.sub(_shown_slot, form.strip()) for form in (wanted[0], wanted[-1])]
    return " or ".join(dict.fromkeys(repr(line) if line else "an empty line" for line in lines))


def _shown_slot(slot: re.Match[str]) -> str:
    return "..." if slot[1].isupper() else slot[0]
