"""Delimited text (.csv, .txt, .tsv) -> Source.

In a plain table the first line that is neither empty nor a comment (#) names the columns; the separator is
comma, semicolon or tab. What instruments write above or next to the table is found by `text_layout`.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.documents import json_document
from modelgen.errors import DataError, Problem
from modelgen.runtime.files.instrument_dialects import DIALECTS, stated_frequency
from modelgen.runtime.files.source import Columns, Source
from modelgen.runtime.files.table_shapes import check_shape
from modelgen.runtime.files.text_layout import (
    END_MARKS,
    NO_READING,
    SPACES,
    Layout,
    cells_of,
    heads,
    number_from,
    reading_from,
    sniff,
)
from modelgen.runtime.files.text_lines import SEPARATORS, encoding_of, lines_of, opened_text
from modelgen.runtime.files.timestamps import nanoseconds, time_since

RECORD_MARK = "# modelgen record "  # followed by JSON: fs, name and tag of a record written by modelgen
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[.,'’ ]\d{3})+(?:[.,]\d+)?")
WITH_POINTS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+")
POINTS_BETWEEN = re.compile(r"(?:^|[;\t \"])[+-]?\d{1,3}(?:\.\d{3})+(?:[;\t \"\r\n]|$)")
Table = FloatArray


def open_text(path: Path) -> Source:
    """Return the source of a delimited text file; its numbers are read when columns are loaded.

    Raises
    ------
    DataError
        When there is no header line of different names; later, naming line and column, when a row is longer
        or shorter than the header or a cell is no number.
    """
    encoding = encoding_of(path)
    check_shape(path, encoding)
    stated = _stated_record(path, encoding)
    fs = stated.get("fs")
    layout = None
    for head in heads(path, encoding):
        layout = next((found for dialect in DIALECTS if (found := dialect(head)) is not None), sniff(head))
        if layout is not None:
            fs = fs or stated_frequency(head)
            break
    layout = layout or _plain(path, encoding)
    problems = _header_problems(layout)
    DataError.raise_any(problems)
    chosen = layout

    def load(names: Sequence[str]) -> Columns:
        return _load(chosen, names)

    return Source(
        path,
        tuple(name for name in layout.names if name),
        load,
        fs=fs,
        name=stated.get("name"),
        tag=stated.get("tag"),
        units=layout.units,
        clocks=layout.clocks,
        took=layout.took,
        load_numeric=lambda names: _numeric(chosen, names),
        starts={name: nanoseconds(first) for name, first in layout.stamps.items()},
    )


def _plain(path: Path, encoding: str) -> Layout:
    """Return the layout of a plain table; its lines are checked when they are read."""
    for number, line in lines_of(path, encoding):
        if line.strip() and not line.startswith("#"):
            separator = max(SEPARATORS, key=lambda candidate: len(cells_of(line, candidate)))
            names = tuple(cells_of(line, separator))
            return Layout(path, encoding, number, separator, separator == ";", names)
    raise DataError.at(str(path), "is empty", "give a header line of column names, then one line a sample")


def _stated_record(path: Path, encoding: str) -> dict[str, Any]:
    """Return fs, name and tag from the comment that modelgen writes above a record of its own."""
    for number, line in lines_of(path, encoding):
        if line.startswith(RECORD_MARK):
            return _stated(f"{path}: line {number}", line.removeprefix(RECORD_MARK))
        if line.strip() and not line.startswith("#"):
            break
    return {}


def _stated(where: str, text: str) -> dict[str, Any]:
    remedy = "remove the line, or write the record again"
    try:
        stated = json_document(text, where, remedy)
    except DataError as error:
        raise DataError.at(where, "is a damaged record header", remedy) from error
    kinds: dict[str, Any] = {"fs": (int, float), "name": str, "tag": (str, type(None))}
    if not isinstance(stated, dict) or not all(isinstance(stated.get(key), kinds[key]) for key in kinds):
        raise DataError.at(where, "is a damaged record header", remedy)
    return stated


def _header_problems(layout: Layout) -> list[Problem]:
    where = f"{layout.path}: line {layout.header_line}"
    if all(number_from(cell, layout.decimal_comma) is not None for cell in layout.names):
        return [Problem(where, "holds numbers, not column names", "put the column names there, without a #")]
    problems = []
    if not layout.took:
        problems = [
            Problem(where, f"column {i} has no name", "name every column, and end no line with a separator")
            for i, name in enumerate(layout.names, start=1)
            if not name
        ]
    problems += [
        Problem(where, f"two columns are named {name}", "give every column its own name")
        for name, count in Counter(layout.names).items()
        if name and count > 1
    ]
    return problems


def _numeric(layout: Layout, names: Sequence[str]) -> Columns:
    """Return the columns without a cell that is no number; none where a line is too long or short."""
    place_of = {name: place for place, name in enumerate(layout.names)}
    places = {name: place_of[name] for name in names}
    readers = {name: _reader(layout, place) for name, place in places.items()}
    columns: dict[str, list[float]] = {name: [] for name in names}
    for _, cells in _sample_lines(layout):
        if len(cells) != len(layout.names) and not layout.took:
            return {}
        for name in list(columns):
            cell = cells[places[name]] if places[name] < len(cells) else ""
            value = readers[name](cell) if cell or not layout.ragged else nan
            if value is None:
                del columns[name]
            elif cell:
                columns[name].append(value)
    return {name: np.array(column, dtype=float) for name, column in columns.items()}


def _load(layout: Layout, names: Sequence[str]) -> Columns:
    """Read columns: all at once where the table holds numbers only, otherwise line by line."""
    place_of = {name: place for place, name in enumerate(layout.names)}
    places = {name: place_of[name] for name in names}
    line_by_line = layout.ragged or (layout.decimal_comma and layout.separator == ",")
    table = None if line_by_line else _fast_table(layout, tuple(places.values()))
    columns = None if table is None else [table[:, place] for place in range(table.shape[1])]
    if columns is None:
        columns = _slow_columns(layout, tuple(places.values()))
    return {name: np.ascontiguousarray(column) for name, column in zip(names, columns, strict=True)}


def _fast_table(layout: Layout, places: tuple[int, ...]) -> Table | None:
    """Return the wanted columns, shape (n, len(places)), or None where a line is not so many numbers."""
    try:
        with opened_text(layout.path, layout.encoding) as file, warnings.catch_warnings():
            warnings.simplefilter("error")  # an empty table is a warning
            rows = (_with_points(layout, line) for line in file) if layout.decimal_comma else file
            # without columns that hold no numbers, every line's width is checked by the parser
            chosen = places if "" in layout.names else None
            times: dict[int | str, Callable[[str], Any]] = {
                layout.names.index(name): time_since(first) for name, first in layout.stamps.items()
            }
            table = np.loadtxt(
                rows,
                encoding=None,  # converters get text
                converters=times,
                delimiter=None if layout.separator == SPACES else layout.separator,
                skiprows=layout.header_line,
                comments=None,
                ndmin=2,
                quotechar='"',
                usecols=chosen,
            )
    except (ValueError, UserWarning):
        return None
    if chosen is not None:
        return table
    return table[:, list(places)] if table.shape[1] == len(layout.names) else None


def _with_points(layout: Layout, line: str) -> str:
    """Return a line of decimal commas with points; one with points between thousands is read cell by cell."""
    if layout.only_commas and "." in line and POINTS_BETWEEN.search(line):
        raise ValueError(line)
    return line.replace(",", ".")


def _slow_columns(layout: Layout, places: tuple[int, ...]) -> list[Table]:
    """Return the wanted columns, or name the first line that is wrong; ragged ones may end before others."""
    columns: list[list[float]] = [[] for _ in places]
    readers = [_reader(layout, place) for place in places]
    for number, cells in _sample_lines(layout):
        where = f"{layout.path}: line {number}"
        # metadata next to or below the samples may make lines shorter; too many cells are a mistake
        wrong = len(cells) != len(layout.names) if not layout.took else any(cells[len(layout.names) :])
        if wrong and not layout.ragged:
            what = f"has {len(cells)} cells, the header has {len(layout.names)}"
            remedy = "give every line one cell a column (a decimal comma needs semicolons as separator)"
            raise DataError.at(where, what, remedy)
        for column, place, read in zip(columns, places, readers, strict=True):
            cell = cells[place] if place < len(cells) else ""
            if not cell and layout.ragged:
                continue
            value = read(cell)
            if value is None:
                kind = "time" if layout.names[place] in layout.stamps else "number"
                remedy = "correct the cell, or start a line that holds no samples with #"
                if ":" in cell:
                    remedy = "write times in s, or as hours:minutes:seconds"
                if THOUSANDS.fullmatch(cell):
                    remedy = "write numbers without a mark between thousands"
                raise DataError.at(
                    f"{where}, column {layout.names[place]}", f"is {cell!r}, no {kind}", remedy
                )
            column.append(value)
    if not any(columns):
        raise DataError.at(str(layout.path), "has a header but no samples", "give one line a sample")
    return [np.array(column, dtype=float) for column in columns]


def _reader(layout: Layout, place: int) -> Callable[[str], float | None]:
    """Return what turns a cell of a column into its value, None where it holds none."""
    first = layout.stamps.get(layout.names[place])
    if first is None:
        return lambda cell: (
            None
            if layout.only_commas and WITH_POINTS.fullmatch(cell)
            else reading_from(cell, layout.decimal_comma)
        )
    since = time_since(first)

    def time(cell: str) -> float | None:
        if cell.lower() in NO_READING:
            return nan
        try:
            return since(cell)
        except ValueError:
            return None

    return time


def _sample_lines(layout: Layout) -> Iterator[tuple[int, list[str]]]:
    for number, line in lines_of(layout.path, layout.encoding):
        if number <= layout.header_line or not line.strip() or line.startswith("#"):
            continue
        cells = cells_of(line, layout.separator)
        if layout.took and cells[0] in END_MARKS and not any(cells[1:]):
            return
        yield number, cells
