"""Which column of a file becomes which channel, in which unit and with which factor."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from modelgen.errors import Problem, shortened
from modelgen.magnitudes import FACTOR_REMEDY, is_usable, shown_number
from modelgen.number_expression import Misread, exact_number
from modelgen.runtime.files.source import Source
from modelgen.runtime.files.units import Unit, states_no_unit, unit_from_text
from modelgen.runtime.records.record import missing_name

NAME_IT = "name it (--map {key}=COLUMN), or let `modelgen import` propose one"


@dataclass(frozen=True)
class Pick:
    """A channel of the record: the file's column times a factor; `unit` is the column's, as `stated`."""

    key: str
    column: str
    factor: float
    unit: Unit | None = None
    scaled: bool = False
    stated: str = ""


def pick_columns(
    source: Source,
    keys: Sequence[str],
    mapping: Mapping[str, str],
    scales: Mapping[str, float | str],
    stated: Mapping[str, str],
) -> tuple[list[Pick], list[Problem]]:
    """Return the channels to read, and one problem per column, factor or unit that is absent or wrong.

    `stated` has the units of columns by channel, where they are not those of the file.
    """
    picks, problems = [], []
    for key in keys:
        place = mapping.get(key, key)
        column = source.column(place.removeprefix("-"))
        if column not in source.known:
            absent = missing_name(f"{source.path}: channel {key}", "column", column, source.names)
            unnamed = "" if key in mapping else f"; {NAME_IT.format(key=key)}"
            problems.append(replace(absent, remedy=absent.remedy + unnamed))
        text = stated.get(key, source.unit_of(column, key))
        unit = unit_from_text(text)
        if unit is None and key in stated and key not in scales:
            what, remedy = f"{text!r} is not known", "give the factor to SI units in its place"
            problems.append(Problem(f"{source.path}: unit of {key}", what, remedy))
        factor = scales.get(key, unit.factor if unit else 1.0)
        if isinstance(factor, str):
            factor = _written_factor(source, key, factor, problems)
        if not is_usable(factor) or factor == 0.0:
            problems.append(
                Problem(f"{source.path}: scale of {key}", f"is {shown_number(factor)}", FACTOR_REMEDY)
            )
            factor = 1.0
        signed = -factor if place.startswith("-") else factor
        picks.append(Pick(key, column, signed, unit, key in scales, text))
    # a misspelt scale would silently leave a channel in the wrong unit
    asked = dict.fromkeys((*keys, *mapping))
    problems += [
        missing_name(f"{source.path}: scale of {key}", "channel", key, asked)
        for key in scales
        if key not in asked
    ]
    if not keys:
        problems.append(Problem(str(source.path), "has no columns to read", "give a file that holds samples"))
    return picks, problems


def _written_factor(source: Source, key: str, text: str, problems: list[Problem]) -> float:
    """Return what a text means: a scalar of the file, or a number such as "2*pi/4096"; 1 of a problem."""
    if text in source.scalars:
        return source.scalars[text]
    where = f"{source.path}: scale of {key}"
    try:
        number = exact_number(text)
    except Misread as found:
        if text[:1].isalpha() or text.startswith("_"):
            problems.append(missing_name(where, "scalar", text, source.scalars))
        else:
            problems.append(Problem(where, f"is {shortened(text)!r}, which {found.what}", found.remedy))
        return 1.0
    return float(number) if is_usable(number) else math.inf


def shared_problems(source: Source, picks: Sequence[Pick], wanted: Collection[str]) -> list[Problem]:
    """Return one problem per column that is to be several of the `wanted` channels."""
    keys: dict[str, list[str]] = {}
    for pick in picks:
        if pick.key in wanted:
            keys.setdefault(pick.column, []).append(pick.key)
    return [
        Problem(
            f"{source.path}: column {column}",
            f"is mapped to {' and to '.join(named)}",
            f"name the other's own column (--map {named[-1]}=COLUMN), or leave that sensor out of the spec",
        )
        for column, named in keys.items()
        if len(named) > 1
    ]


def unit_problems(source: Source, picks: Sequence[Pick], wanted: Mapping[str, str]) -> list[Problem]:
    """Return one problem per column that states another quantity than wanted (SI units), or one that is not
    known, without a factor.

    A torque logged as a current needs its torque constant: without it every number would be in a wrong unit.
    """
    found = []
    for pick in picks:
        asked, unit = wanted.get(pick.key), pick.unit
        if pick.scaled or not asked or not pick.stated or states_no_unit(pick.stated):
            continue
        # a share of what a drive can do is no number that stands for itself
        if unit is not None and (unit.si == asked or (unit.si, unit.factor) == ("1", 1.0)):
            continue
        unknown = "" if unit else ", a unit that is not known"
        what = f"column {pick.column} is in {pick.stated}{unknown}, and {asked} is needed"
        remedy = (
            f"give its factor, {asked} per {pick.stated}: --scale {pick.key}=FACTOR, or factor in a map file"
        )
        found.append(Problem(f"{source.path}: channel {pick.key}", what, remedy))
    return found


def units_of_numbers(picks: Sequence[Pick]) -> dict[str, str]:
    """Return what the numbers of channels are in, by channel, where a file says it and no factor is given."""
    return {
        # a share of what a drive can do is one of a number that the file does not hold
        pick.key: pick.unit.si if pick.unit and pick.unit.si != "1" else pick.stated
        for pick in picks
        if pick.stated and not pick.scaled and not states_no_unit(pick.stated)
    }


def taken_for(source: Source, picks: Sequence[Pick]) -> tuple[str, ...]:
    """Return how the file was interpreted: its layout, and every unit that was converted or is unknown."""
    said = list(source.took)
    for pick in picks:
        text = pick.stated
        if pick.unit is None:
            if text and not pick.scaled:
                said.append(
                    f"{pick.key}: column {pick.column} is in {text!r}, an unknown unit; not converted"
                )
            continue
        if not pick.scaled and pick.unit.factor != 1.0:
            said.append(f"{pick.key}: column {pick.column} converted from {text} to {pick.unit.si}")
    return tuple(said)
