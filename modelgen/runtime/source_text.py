"""Delimited text (.csv, .txt, .tsv) -> Source.

The first line that is neither empty nor a comment (#) names the columns. The separator is comma, semicolon or
tab; with semicolons a comma is the decimal point.
"""

from __future__ import annotations

import csv
import json
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.errors import DataError, Problem
from modelgen.runtime.source import Columns, Source

RECORD_MARK = "# modelgen record "  # followed by JSON: fs, name and tag of a record written by modelgen
SEPARATORS = "\t;,"


@dataclass(frozen=True)
class Layout:
    """How a text file is written."""

    path: Path
    encoding: str
    header_line: int  # counted from 1
    separator: str
    names: tuple[str, ...]

    @property
    def decimal_comma(self) -> bool:
        """Whether a comma is the decimal point."""
        return self.separator == ";"


def open_text(path: Path) -> Source:
    """Return the source of a delimited text file; its numbers are read when columns are asked for.

    Raises
    ------
    DataError
        When there is no header line of different names; later, naming line and column, when a row is longer
        or shorter than the header or a cell is no number.
    """
    encoding = _encoding(path)
    stated: dict[str, Any] = {}
    for number, line in _lines(path, encoding):
        if line.startswith(RECORD_MARK):
            stated = _stated(f"{path}: line {number}", line.removeprefix(RECORD_MARK))
        if line.strip() and not line.startswith("#"):
            break
    else:
        raise DataError.at(
            str(path), "is empty", "give a header line of column names, then one line a sample"
        )
    separator = max(SEPARATORS, key=lambda candidate: len(_cells(line, candidate)))
    layout = Layout(path, encoding, number, separator, tuple(_cells(line, separator)))
    problems = _header_problems(layout)
    if problems:
        raise DataError(*problems)

    def load(names: Sequence[str]) -> Columns:
        return _load(layout, names)

    return Source(
        path, layout.names, load, fs=stated.get("fs"), name=stated.get("name"), tag=stated.get("tag")
    )


def _encoding(path: Path) -> str:
    """Return the encoding: by its mark, else UTF-8 where the file is, else Latin-1 (old instruments)."""
    data = path.read_bytes()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    with path.open(encoding=encoding) as file:
        for number, line in enumerate(file, start=1):
            yield number, line.rstrip("\n")


def _cells(line: str, separator: str) -> list[str]:
    # only quoted cells need a parser, which is slow
    cells = next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)
    return [cell.strip() for cell in cells]


def _stated(where: str, text: str) -> dict[str, Any]:
    """Return fs, name and tag from the comment that modelgen writes."""
    remedy = "remove the line, or write the record again"
    try:
        stated = json.loads(text)
    except ValueError as error:
        raise DataError.at(where, "is a damaged record header", remedy) from error
    kinds: dict[str, Any] = {"fs": (int, float), "name": str, "tag": (str, type(None))}
    if not isinstance(stated, dict) or not all(isinstance(stated.get(key), kinds[key]) for key in kinds):
        raise DataError.at(where, "is a damaged record header", remedy)
    return stated


def _header_problems(layout: Layout) -> list[Problem]:
    where = f"{layout.path}: line {layout.header_line}"
    if all(_number(cell, layout.decimal_comma) is not None for cell in layout.names):
        return [Problem(where, "holds numbers, not column names", "put the column names there, without a #")]
    problems = [
        Problem(where, f"column {index} has no name", "name every column, and end no line with a separator")
        for index, name in enumerate(layout.names, start=1)
        if not name
    ]
    problems += [
        Problem(where, f"two columns are named {name}", "give every column its own name")
        for name in dict.fromkeys(layout.names)
        if name and layout.names.count(name) > 1
    ]
    return problems


def _number(cell: str, decimal_comma: bool) -> float | None:
    text = cell.replace(",", ".") if decimal_comma else cell
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _load(layout: Layout, names: Sequence[str]) -> Columns:
    """Read columns: all at once where the table holds numbers only, otherwise line by line."""
    places = {name: layout.names.index(name) for name in names}
    table = _fast_table(layout)
    if table is None:
        table = _slow_table(layout, tuple(places.values()))
        places = {name: place for place, name in enumerate(places)}
    return {name: np.ascontiguousarray(table[:, place]) for name, place in places.items()}


def _fast_table(layout: Layout) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return the table, shape (n, columns), or None where it is anything but equal rows of numbers."""
    try:
        with layout.path.open(encoding=layout.encoding) as file, warnings.catch_warnings():
            warnings.simplefilter("error")  # an empty table is a warning
            rows = (line.replace(",", ".") for line in file) if layout.decimal_comma else file
            table = np.loadtxt(
                rows,
                delimiter=layout.separator,
                skiprows=layout.header_line,
                comments=None,
                ndmin=2,
                quotechar='"',
            )
    except (ValueError, UserWarning):
        return None
    return table if table.shape[1] == len(layout.names) else None


def _slow_table(layout: Layout, places: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the wanted columns, shape (n, len(places)), or name the first line that is wrong."""
    rows = []
    for number, line in _lines(layout.path, layout.encoding):
        if number <= layout.header_line or not line.strip() or line.startswith("#"):
            continue
        cells = _cells(line, layout.separator)
        where = f"{layout.path}: line {number}"
        if len(cells) != len(layout.names):
            what = f"has {len(cells)} cells, the header has {len(layout.names)}"
            remedy = "give every line one cell a column (a decimal comma needs semicolons as separator)"
            raise DataError.at(where, what, remedy)
        values = [_number(cells[place], layout.decimal_comma) for place in places]
        for place, value in zip(places, values, strict=True):
            if value is None:
                what = f"is {cells[place]!r}, no number" if cells[place] else "is empty"
                remedy = "correct the cell, or start a line that holds no samples with #"
                raise DataError.at(f"{where}, column {layout.names[place]}", what, remedy)
        rows.append(values)
    if not rows:
        raise DataError.at(str(layout.path), "has a header but no samples", "give one line a sample")
    return np.array(rows, dtype=float)
