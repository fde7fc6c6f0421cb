"""The text of the options --map and --scale -> columns and factors; every mistake is explained."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import TypeVar

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import is_usable
from modelgen.number_expression import Misread, exact_number

T = TypeVar("T")
CHANNEL_KEY = r"[A-Za-z][A-Za-z0-9_]{0,63}"


def parse_mapping(options: Iterable[str]) -> dict[str, str]:
    """Return the mapping that options such as ``"q_m=theta_mx"`` and ``"q_c=-theta_my"`` spell.

    Raises
    ------
    DataError
        With one problem per option that is not KEY=COLUMN or repeats a key.
    """
    form = "write KEY=COLUMN, with a minus before COLUMN to negate it: --map q_c=-theta_my"
    return _parse("--map", options, form, lambda text: text if text.removeprefix("-") else None)


def parse_scales(options: Iterable[str]) -> dict[str, float | str]:
    """Return the factors that ``"F=35.15"``, ``"q=2*pi/4096"`` or ``"F=gtau"`` (a scalar in the file) spell.

    Raises
    ------
    DataError
        With one problem per option that is not KEY=FACTOR or repeats a key.
    """
    what = "a number other than zero or the name of a scalar in the file"
    form = f"write KEY=FACTOR, {what}: --scale q_m=2*pi/4096"
    return _parse("--scale", options, form, _factor_from_text)


def parse_names(option: str, items: Iterable[str]) -> dict[str, str]:
    """Return the names that options such as ``"sign_c=q_b"`` give to names.

    Raises
    ------
    DataError
        With one problem per option that is not NAME=VALUE or repeats a name.
    """
    return _parse(option, items, f"write {option} NAME=VALUE", lambda text: text or None)


def _parse(option: str, items: Iterable[str], form: str, value_of: Callable[[str], T | None]) -> dict[str, T]:
    parsed: dict[str, T] = {}
    problems = []
    for item in items:
        key, _, text = (part.strip() for part in item.partition("="))
        value = value_of(text)
        if value is None or not re.fullmatch(CHANNEL_KEY, key):
            problems.append(Problem(f"{option} {item}", "cannot be read", form))
        elif key in parsed:
            problems.append(Problem(f"{option} {item}", f"gives {key} a second time", "give every key once"))
        else:
            parsed[key] = value
    DataError.raise_any(problems)
    return parsed


def _factor_from_text(text: str) -> float | str | None:
    try:
        factor = float(text)
    except ValueError:
        try:
            number = exact_number(text)
        except Misread:
            return text if re.fullmatch(r"[A-Za-z_]\w*", text) else None
        factor = float(number) if is_usable(number) else 0.0
    return factor if is_usable(factor) and factor != 0.0 else None
