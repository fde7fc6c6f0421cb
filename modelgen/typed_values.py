"""Plain values of JSON or TOML -> dataclasses, by the types of their fields; every mistake is named.

The inverse of `dataclasses.asdict` on values that JSON holds. Null stands for a number that was not finite.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import date, datetime
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from modelgen.errors import Problem, listed, nearest

WORDS = {
    str: "a text",
    int: "a whole number",
    bool: "true or false",
    float: "a number",
    date: "a date such as 2026-01-31",
}
# what divides by a value that may be zero is infinite where it is not finite
INFINITE = ("relative", "condition_number")


def typed(kind: Any, value: Any, where: str, remedy: str, problems: list[Problem]) -> Any:
    """Return a value as the type it was written from; None where it cannot be, with a problem a mistake.

    Parameters
    ----------
    kind : type
        str, int, bool, float, date, ``Literal``, a dataclass of such, ``tuple[X, ...]``, ``tuple[X, Y]``,
        ``Mapping[str, X]``, and unions of them, whose first one that suits counts.
    value : object
        As JSON has it: texts, numbers, lists, tables.
    where : str
        The file and key that messages speak of.
    remedy : str
        What to do about a mistake.
    problems : list of Problem
        Mistakes are added to it.
    """

    def inner(one: Any, part: Any, name: str) -> Any:
        return typed(one, part, f"{where}{name}", remedy, problems)

    def wrong(what: str) -> None:
        problems.append(Problem(where, what, remedy))

    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _union([one for one in arguments if one is not type(None)], value, where, remedy, problems)
    if origin is Literal:
        known = isinstance(value, str) and value in arguments
        return value if known else wrong(f"is none of {listed(arguments)}")
    if is_dataclass(kind) and isinstance(kind, type):
        return _dataclass(kind, value, where, remedy, problems)
    if origin is tuple:
        many = len(arguments) == 2 and arguments[1] is Ellipsis
        if not isinstance(value, list) or not (many or len(value) == len(arguments)):
            return wrong("is no list" if many else f"is no list of {len(arguments)} values")
        kinds = [arguments[0]] * len(value) if many else arguments
        pairs = zip(kinds, value, strict=True)
        return tuple(inner(one, part, f"[{k}]") for k, (one, part) in enumerate(pairs))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            return wrong("is no table")
        return {key: inner(arguments[1], part, f".{key}") for key, part in value.items()}
    if kind is float:
        return _number(value, where, wrong)
    if not isinstance(value, kind) or isinstance(value, {int: bool, date: datetime}.get(kind, ())):
        return wrong(f"is not {WORDS[kind]}")
    return value


def _union(kinds: list[Any], value: Any, where: str, remedy: str, problems: list[Problem]) -> Any:
    """Return a value as the first type that it suits; else with the mistakes of the type nearest to it."""
    if value is None:
        return None
    tried: list[list[Problem]] = []
    for kind in kinds:
        found: list[Problem] = []
        read = typed(kind, value, where, remedy, found)
        if not found:
            return read
        tried.append(found)
    # mistakes inside of a table or list say more than that it is no text
    inside = [found for found in tried if found[0].where != where]
    problems += (inside or tried)[0]
    return None


def _number(value: Any, where: str, wrong: Any) -> float | None:
    if value is None:
        return math.inf if re.split(r"[. ]", where)[-1].startswith(INFINITE) else math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        wrong(f"is not {WORDS[float]}")
        return None
    return float(value)


def _dataclass(kind: Any, value: Any, where: str, remedy: str, problems: list[Problem]) -> Any:
    """Return a dataclass; a field that is absent must have a default."""
    if not isinstance(value, dict):
        problems.append(Problem(where, "is no table", remedy))
        return None
    hints, before = get_type_hints(kind), len(problems)
    prefix = where if where.endswith(": ") else f"{where}."
    own = {one.name: one for one in fields(kind)}
    for key in value:
        if key not in own:
            guess = nearest(key, own)
            meant = f"did you mean {guess}?" if guess else f"choose from {listed(own)}"
            problems.append(Problem(f"{prefix}{key}", "is not known", meant))
    given: dict[str, Any] = {}
    for name, one in own.items():
        if name in value:
            given[name] = typed(hints[name], value[name], f"{prefix}{name}", remedy, problems)
        elif one.default is one.default_factory:  # both are "missing"
            problems.append(Problem(f"{prefix}{name}", "is missing", remedy))
    return kind(**given) if len(problems) == before else None
