"""Files -> Record: which column is which channel, in which unit, sampled how fast."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem
from modelgen.runtime.data import Record, missing_name
from modelgen.runtime.sampling import sampling_frequency
from modelgen.runtime.source import Columns, Source
from modelgen.runtime.source_binary import open_mat, open_npz
from modelgen.runtime.source_text import open_text

OPENERS = {".csv": open_text, ".txt": open_text, ".tsv": open_text, ".npz": open_npz, ".mat": open_mat}
TIME_NAMES = ("t", "time", "Time")
T = TypeVar("T")
CHANNEL_KEY = r"[A-Za-z][A-Za-z0-9_]{0,63}"


def read_record(
    path: str | Path,
    mapping: Mapping[str, str] | None = None,
    scales: Mapping[str, float | str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    name: str | None = None,
    tag: str | None = None,
    needed: Sequence[str] | None = None,
) -> Record:
    """Read one record from a file.

    Parameters
    ----------
    path : str or Path
        A ``.csv``, ``.txt`` or ``.tsv`` file with a header line, a ``.npz`` archive of plain arrays, or a
        ``.mat`` file up to version 7.
    mapping : mapping of str to str, optional
        Channel key to the file's column, a leading minus negates:
        ``{"q_m": "theta_mx", "q_c": "-theta_my"}``. A channel that is not mapped keeps its own key.
    scales : mapping of str to (float or str), optional
        Factor a channel is multiplied by, to bring it to SI units: a number, or the name of a scalar that the
        file holds.
    fs : float, optional
        Sampling frequency in Hz. Otherwise what the file states (a scalar ``fs``), or the column of times.
    time : str, optional
        Column of times in seconds; by default ``t`` or ``time`` where the file has it. It must agree with the
        sampling frequency that is given or stated, see `modelgen.runtime.sampling`.
    name, tag : str, optional
        Of the record; by default those the file states, else the file's name without suffix.
    needed : sequence of str, optional
        Keys to put into the record, usually ``model.channels``; by default the keys of `mapping`, and without
        a mapping every column but that of the times.

    Raises
    ------
    DataError
        With one problem per mistake: the file, an absent column, a cell that is no number, non-uniform times,
        a sampling frequency that is missing or contradicted.
    """
    source = _open(Path(path))
    clock = time or next((known for known in TIME_NAMES if known in source.names), None)
    if needed is None:
        needed = tuple(mapping or (column for column in source.names if column != clock))
    picks, problems = _picks(source, needed, mapping or {}, scales or {})
    if time is not None and time not in source.names:
        problems.append(missing_name(f"{path}: times", "column", time, source.names))
    if problems:
        raise DataError(*problems)
    stated = source.fs if fs is None else fs
    loaded = _load(source, picks, clock, optional=time is None and stated is not None)
    signals = {pick.key: _in_si(loaded[pick.column], pick.factor) for pick in picks}
    times = _times(source, loaded, clock, picks, given=time is not None)
    return Record(
        signals,
        sampling_frequency(f"{path}: column {clock}" if times is not None else str(path), stated, times),
        name=name or source.name or source.path.stem,
        tag=source.tag if tag is None else tag,
    )


def available_channels(path: str | Path) -> tuple[str, ...]:
    """Return the names of a data file's columns, the times included.

    Raises
    ------
    DataError
        When the file is absent or of no known format.
    """
    return _open(Path(path)).names


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
    """Return the factors that options such as ``"F=35.15"`` or ``"F=gtau"`` (a scalar in the file) spell.

    Raises
    ------
    DataError
        With one problem per option that is not KEY=FACTOR or repeats a key.
    """
    form = "write KEY=FACTOR, a number other than zero or the name of a scalar in the file: --scale q_m=0.001"
    return _parse("--scale", options, form, _factor_from_text)


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
    if problems:
        raise DataError(*problems)
    return parsed


def _factor_from_text(text: str) -> float | str | None:
    try:
        factor = float(text)
    except ValueError:
        return text if re.fullmatch(r"[A-Za-z_]\w*", text) else None
    return factor if _is_factor(factor) else None


def _is_factor(value: float) -> bool:
    return math.isfinite(value) and value != 0.0


def _open(path: Path) -> Source:
    opener = OPENERS.get(path.suffix.lower())
    if opener is None:
        what = f"has the suffix {path.suffix!r}" if path.suffix else "has no suffix"
        raise DataError.at(str(path), what, f"give a file of one of the formats {', '.join(OPENERS)}")
    try:
        return opener(path)
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError.at(str(path), f"cannot be read ({reason})", "check the path and the file") from error


@dataclass(frozen=True)
class _Pick:
    """A channel of the record: the file's column times a factor."""

    key: str
    column: str
    factor: float


def _picks(
    source: Source, keys: Sequence[str], mapping: Mapping[str, str], scales: Mapping[str, float | str]
) -> tuple[list[_Pick], list[Problem]]:
    """Return the channels to read, and one problem per column or factor that is absent or wrong."""
    picks, problems = [], []
    for key in keys:
        place = mapping.get(key, key)
        column = place.removeprefix("-")
        if column not in source.names:
            problems.append(missing_name(f"{source.path}: channel {key}", "column", column, source.names))
        factor = scales.get(key, 1.0)
        if isinstance(factor, str):
            if factor not in source.scalars:
                problems.append(
                    missing_name(f"{source.path}: scale of {key}", "scalar", factor, source.scalars)
                )
            factor = source.scalars.get(factor, 1.0)
        if not _is_factor(factor):
            remedy = "give a finite number other than zero"
            problems.append(Problem(f"{source.path}: scale of {key}", f"is {factor!r}", remedy))
        picks.append(_Pick(key, column, -factor if place.startswith("-") else factor))
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


def _load(source: Source, picks: Sequence[_Pick], clock: str | None, optional: bool) -> Columns:
    """Load the picked columns and the times, which may be unreadable where nobody asked for them."""
    columns = dict.fromkeys(pick.column for pick in picks)
    try:
        return source.load(tuple(dict.fromkeys((*columns, *([clock] if clock else [])))))
    except DataError:
        if not clock or not optional or clock in columns:
            raise
        return source.load(tuple(columns))


def _in_si(values: npt.NDArray[Any], factor: float) -> npt.NDArray[Any]:
    # what is no real number (a flag, a complex value) is left for the record to refuse
    return values * np.float64(factor) if factor != 1.0 and values.dtype.kind in "iuf" else values


def _times(
    source: Source, loaded: Columns, clock: str | None, picks: Sequence[_Pick], given: bool
) -> npt.NDArray[np.float64] | None:
    """Return the times, or None where the file has none of the channels' length."""
    if clock not in loaded:
        return None
    length = loaded[picks[0].column].size
    if loaded[clock].size == length and loaded[clock].dtype.kind in "iuf":
        return loaded[clock].astype(float)
    if not given:
        return None
    what = f"has {loaded[clock].size} samples of type {loaded[clock].dtype}, the channels have {length}"
    raise DataError.at(f"{source.path}: column {clock}", what, "name the column of times of these channels")
