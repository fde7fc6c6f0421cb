"""Plain values of JSON -> dataclasses, by the types that their fields declare; every mistake is named.

The inverse of `dataclasses.asdict` on values that JSON holds. Null stands for a number that was not finite.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Union, get_args, get_origin, get_type_hints

from modelgen.errors import Problem, listed

WORDS = {str: "a text", int: "a whole number", bool: "true or false", float: "a number or null"}
# what divides by a value that may be zero is infinite where it is not finite
INFINITE = ("relative", "condition_number")


def typed(kind: Any, value: Any, where: str, remedy: str, problems: list[Problem]) -> Any:
    """Return a value as the type it was written from; None where it cannot be, with a problem a mistake.

    Parameters
    ----------
    kind : type
        str, int, bool, float, a dataclass of such, ``tuple[X, ...]``, ``tuple[X, Y]``, ``Mapping[str, X]``,
        and any of them or None.
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
        rest = [one for one in arguments if one is not type(None)]
        return None if value is None else inner(rest[0], value, "")
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
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        return wrong(f"is not {WORDS[kind]}")
    return value


def _number(value: Any, where: str, wrong: Any) -> float | None:
    if value is None:
        return math.inf if where.rpartition(".")[2].startswith(INFINITE) else math.nan
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
    own = {one.name: one for one in fields(kind)}
    for key in value:
        if key not in own:
            problems.append(Problem(f"{where}.{key}", f"is not known beside {listed(own)}", remedy))
    given: dict[str, Any] = {}
    for name, one in own.items():
        if name in value:
            given[name] = typed(hints[name], value[name], f"{where}.{name}", remedy, problems)
        elif one.default is one.default_factory:  # both are "missing"
            problems.append(Problem(f"{where}.{name}", "is missing", remedy))
    return kind(**given) if len(problems) == before else None
