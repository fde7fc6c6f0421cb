"""Names and values of a TOML file in messages, and what a name may be."""

from __future__ import annotations

import json
import keyword
import math
import re
from collections.abc import Iterable
from fractions import Fraction

from modelgen.errors import listed, nearest

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
# "type" is a keyword since Python 3.12 only: refused everywhere, so that a spec means the same everywhere
_KEYWORDS = frozenset({*keyword.kwlist, *keyword.softkwlist, "type"})


def identifier_problem(text: str) -> tuple[str, str] | None:
    """Return what is wrong with a name and the remedy; None if it is good."""
    if not _IDENTIFIER.fullmatch(text):
        return f"{shown(text)} is not a name", "use a letter, then letters, digits or _ (ASCII, 64 at most)"
    if text in _KEYWORDS:
        return f"{shown(text)} is a word of the Python language", f"choose another name, such as {text}_1"
    return None


def path(*keys: str | int) -> str:
    """Write a key's path as TOML does: bodies[0].inertia, sensors."my set".q_m."""
    text = ""
    for key in keys:
        bare = isinstance(key, int) or re.fullmatch(r"[A-Za-z0-9_-]{1,64}", key)
        text += f"[{key}]" if isinstance(key, int) else f".{key if bare else shown(key)}"
    return text.removeprefix(".")


def shown(value: object) -> str:
    """Name a value of a TOML file in a message: short, on one line, without invisible characters."""
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=not str(value).isprintable())
        return text if len(text) <= 60 else f'{text[:56]}..."'
    if isinstance(value, int | float):
        return "one too large to store" if 1e300 < abs(value) < math.inf else str(value)
    if isinstance(value, Fraction):  # of a text such as "1/3"
        return f"{float(value):g}"
    if isinstance(value, list):
        numbers = all(isinstance(item, int | float) for item in value)
        return f"a list of {len(value)}{' numbers' if numbers else ''}"
    return "a table" if isinstance(value, dict) else "a date or time"


def suggest(name: str, names: Iterable[str], kind: str) -> str:
    """Return the remedy for a misspelt name: the nearest of the right ones, or their list."""
    known = list(names)
    close = nearest(name, known)
    if close is not None:
        return f"did you mean {shown(close)}?"
    return f"the {kind} are {listed(known)}" if known else f"there are no {kind} here"
