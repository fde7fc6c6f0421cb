"""Sentences with a hole: what is left of one where a list of names was empty."""

from __future__ import annotations

import re

HOLES = (
    re.compile(r"\s[,;:.)](?=\s|$)"),  # a name is missing in front of it
    re.compile(r"[,:;(]\s*[,:;.)]"),  # ... or between two
    re.compile(r"\(\s*\)"),
    re.compile(r"\b(?:of|on|from|and|by|with|in|are|is|leaves|needs|lack)\s*(?:[,;:.)]|$)"),
    re.compile(r"^\s*[,;:.]"),
    re.compile(r"[,:;(]\s*$"),
    re.compile(r"\S  +\S"),
)


def hole(sentence: str) -> str | None:
    """Return the place where a sentence lacks a name, None where it is whole."""
    for pattern in HOLES:
        found = pattern.search(sentence)
        if found:
            return sentence[max(found.start() - 20, 0) : found.end() + 20]
    return None
