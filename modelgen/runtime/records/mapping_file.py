"""Mapping file: which column of a data file is which channel, as TOML that a person may edit.

[time]
column = "time"
unit = "ms"
period_s = 0.5                     # of the excitation, where it is periodic

[channels.q_m]
column = "theta"
factor = 0.017453292519943295      # deg -> rad
negate = false

mend = ["duplicates"]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from modelgen.documents import toml_document, toml_string
from modelgen.errors import DataError, Problem, visible
from modelgen.magnitudes import FACTOR_REMEDY, FREQUENCY_REMEDY, is_frequency, is_usable
from modelgen.read_file import MAPPING, read_text
from modelgen.runtime.files.units import states_no_unit, unit_from_text

TABLES = {"time": ("column", "unit", "fs_hz", "period_s"), "channel": ("column", "factor", "negate", "unit")}


@dataclass(frozen=True)
class MappingFile:
    """What a mapping file says, in the words of `modelgen.runtime.records.read_record.read_record`."""

    columns: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float | str] = field(default_factory=dict)
    time: str | None = None
    time_unit: str | None = None
    fs_hz: float | None = None
    mend: tuple[str, ...] = ()
    period_s: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)


def load_mapping(path: str | Path) -> MappingFile:
    """Read a mapping file.

    Raises
    ------
    DataError
        With one problem per mistake in it.
    """
    document = toml_document(read_text(path, MAPPING), str(path), ("channels", "time", "mend"))
    problems = _shape_problems(str(path), document)
    DataError.raise_any(problems)
    channels = document.get("channels", {})
    time = document.get("time", {})
    return MappingFile(
        {key: ("-" if entry.get("negate") else "") + entry["column"] for key, entry in channels.items()},
        {key: entry["factor"] for key, entry in channels.items() if "factor" in entry},
        time.get("column"),
        time.get("unit"),
        time.get("fs_hz"),
        tuple(document.get("mend", ())),
        time.get("period_s"),
        {key: entry["unit"] for key, entry in channels.items() if "unit" in entry},
    )


@dataclass(frozen=True)
class Proposed:
    """A channel and the column proposed for it (None: none fits), with the unit stated there and why.

    `negate` says that the column counts the other way round.
    """

    key: str
    unit: str
    column: str | None
    stated: str | None
    why: str
    negate: bool = False

    @property
    def lacks_factor(self) -> bool:
        """Whether its column states a unit from which none leads to the channel's."""
        unit = unit_from_text(self.stated or "")
        if self.column is None or not self.stated or states_no_unit(self.stated):
            return False
        return unit is None or bool(self.unit and unit.si != self.unit)


def mapping_text(
    source: str,
    proposed: tuple[Proposed, ...],
    time: str | None,
    time_unit: str | None,
    fs_hz: float | None,
    mends: tuple[str, ...],
) -> str:
    """Return the text of a mapping file; what could not be decided is written as a comment."""
    lines = [
        f"# Channels of {visible(source)} for: modelgen identify DATA --model MODULE.py --map-file THIS_FILE"
    ]
    lines += ["# Check every line, and correct what was taken wrongly.", ""]
    if mends:
        lines += ["# Found wrong with the file; remove the # before what is to be mended:"]
        lines += [f"# mend = {json.dumps(list(dict.fromkeys(mends)))}", ""]
    if time is not None or fs_hz is not None:
        lines.append("[time]")
        lines += [f"column = {toml_string(time)}"] if time is not None else []
        lines += [f"unit = {toml_string(time_unit or 's')}"] if time is not None else []
        lines += [f"fs_hz = {fs_hz!r}"] if fs_hz is not None else []
        lines.append("")
    for entry in proposed:
        lines += [*_channel_lines(entry), ""]
    return "\n".join(lines)


def _channel_lines(entry: Proposed) -> list[str]:
    if entry.column is None:
        wanted = f" in {entry.unit}" if entry.unit else ""
        return [
            f"# {entry.key}{wanted}: no column fits; {entry.why}",
            f"# [channels.{entry.key}]",
            '# column = "..."',
        ]
    lines = [f"[channels.{entry.key}]  # {entry.why}", f"column = {toml_string(entry.column)}"]
    unit = unit_from_text(entry.stated or "")
    if unit is not None and (not entry.unit or unit.si == entry.unit):
        lines.append(f"factor = {unit.factor!r}  # {_comment(entry.stated)} -> {unit.si}")
    elif entry.lacks_factor:
        unknown = "" if unit else ", a unit that is not known"
        per = f"{entry.unit or 'SI'} per {_comment(entry.stated)}{unknown}"
        lines.append(f"# factor = ...  # {per}, to be written here")
    else:
        wanted = f"; {entry.unit} wanted" if entry.unit else ""
        lines.append(f"factor = 1.0  # no unit is stated{wanted}")
    return [*lines, f"negate = {'true' if entry.negate else 'false'}"]


def _comment(text: str | None) -> str:
    return "".join(letter for letter in text or "" if letter.isprintable())


def _shape_problems(where: str, document: Mapping[str, Any]) -> list[Problem]:
    problems = [
        Problem(f"{where}: {key}", "is not known", "write [time], [channels.KEY] or mend = [...]")
        for key in document
        if key not in ("time", "channels", "mend")
    ]
    channels = document.get("channels", {})
    if not isinstance(channels, Mapping) or not channels:
        problems.append(Problem(f"{where}: channels", "is missing", "write a table [channels.KEY] a channel"))
        channels = {}
    for key, entry in channels.items():
        problems += _table_problems(f"{where}: channels.{key}", entry, "channel")
        if isinstance(entry, Mapping) and not isinstance(entry.get("column"), str):
            remedy = 'write column = "NAME"'
            problems.append(Problem(f"{where}: channels.{key}.column", "is missing or no text", remedy))
    if "time" in document:
        problems += _table_problems(f"{where}: time", document["time"], "time")
    mend = document.get("mend", [])
    if not isinstance(mend, list) or not all(isinstance(item, str) for item in mend):
        problems.append(Problem(f"{where}: mend", "is no list of texts", 'write mend = ["duplicates"]'))
    return problems


def _table_problems(where: str, table: Any, kind: str) -> list[Problem]:
    if not isinstance(table, Mapping):
        return [Problem(where, "is no table", f"write [{where.rpartition(': ')[2]}]")]
    problems = [
        Problem(f"{where}.{key}", "is not known", f"choose from {', '.join(TABLES[kind])}")
        for key in table
        if key not in TABLES[kind]
    ]
    checks = {"column": (str, "a text"), "unit": (str, "a text"), "negate": (bool, "true or false")}
    for key, (expected, words) in checks.items():
        if key in table and not isinstance(table[key], expected):
            problems.append(Problem(f"{where}.{key}", f"is {table[key]!r}", f"give {words}"))
    for key in ("factor", "fs_hz", "period_s"):
        value = table.get(key, 1.0)
        if key == "factor" and isinstance(value, str) and value:
            continue  # the name of a scalar that the file holds
        number = isinstance(value, (int, float)) and not isinstance(value, bool) and is_usable(value)
        if not number or value == 0.0 or (key != "factor" and value < 0.0):
            problems.append(Problem(f"{where}.{key}", f"is {value!r}", FACTOR_REMEDY))
        elif key == "fs_hz" and not is_frequency(value):
            problems.append(Problem(f"{where}.{key}", f"is {value!r}", FREQUENCY_REMEDY))
    return problems
