"""What a text file is: encoding, separator, decimal mark, and which lines are names, units and samples.

Plain tables (names in the first line, samples from the second on) and what instruments put above them: lines
of metadata, a line of units, a column of times for every channel. `instrument_dialects` holds the layouts
that cannot be recognised from the lines alone.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path

from modelgen.errors import listed
from modelgen.runtime.files.source import is_time_name
from modelgen.runtime.files.text_lines import SEPARATORS, first_lines
from modelgen.runtime.files.timestamps import is_date, is_long_count, nanoseconds
from modelgen.runtime.files.units import split_titles, states_no_unit, unit_from_text

SPACES = " "  # any number of them, tried where none of the others separates more
# in quotes between commas: a point that is a comma, unless three digits follow, which may be thousands
QUOTED_COMMA = re.compile(r"[+-]?\d+,(?:\d{1,2}|\d{4,})(?:[eE][+-]?\d+)?")
# what programs write into a cell that has no reading; pandas leaves it empty, spreadsheets have words for it
NO_READING = ("", "na", "n/a", "#n/a", "#nv", "null", "none", "-", "--", "---", "n. def.", "n.def.", "<na>")
END_MARKS = ("EOF", "//END")


@dataclass(frozen=True)
class Layout:
    """How a text file is written.

    `names` holds one name a column, "" for a column that is no channel; `header_line` is the last line above
    the samples, counted from 1. `clocks` maps a channel to its column of times, `ragged` says whether columns
    may end before the others; `stamps` maps a column of times as text to the first time, from which
    it is counted; `took` is what was taken for what; `only_commas` says that fractions have a
    decimal comma, so that a point stands between thousands.
    """

    path: Path
    encoding: str
    header_line: int
    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    clocks: Mapping[str, str] = field(default_factory=dict)
    ragged: bool = False
    stamps: Mapping[str, str] = field(default_factory=dict)
    took: tuple[str, ...] = ()
    only_commas: bool = False


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line, quotes removed."""
    if separator == SPACES:
        return line.split()
    # only quoted cells need a parser, which is slow
    cells = next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)
    return [cell.strip() for cell in cells]


def number_from(cell: str, decimal_comma: bool) -> float | None:
    """Return the number a cell holds, or None."""
    text = cell.replace(",", ".") if decimal_comma else cell
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def reading_from(cell: str, decimal_comma: bool) -> float | None:
    """Return the number a cell holds, NaN where it says that there is none, None for any other text."""
    number = number_from(cell, decimal_comma)
    return nan if number is None and cell.lower() in NO_READING else number


@dataclass(frozen=True)
class Head:
    """The first lines of a file, split one way; `first` is the place of the first line of samples."""

    path: Path
    encoding: str
    separator: str
    decimal_comma: bool
    lines: tuple[tuple[int, tuple[str, ...]], ...]  # (number, cells), without empty lines and comments
    first: int

    @property
    def width(self) -> int:
        """Cells of a line of samples."""
        return len(self.lines[self.first][1])


def heads(path: Path, encoding: str) -> Iterator[Head]:
    """Yield every way to split the file that gives two lines of numbers in a row, the most columns first."""
    lines_above = first_lines(path, encoding)
    found = []
    for separator in (*SEPARATORS, SPACES):
        lines = tuple((number, tuple(cells_of(line, separator))) for number, line in lines_above)
        for comma in (False, True) if separator != "," or _quoted_commas(lines) else (False,):
            first = _first_samples(lines, comma)
            if first is not None:
                found.append(Head(path, encoding, separator, comma, lines, first))
    # a decimal comma read as a point would make text of most cells: the earliest and widest table is meant
    yield from sorted(found, key=lambda head: (-head.width, head.first, head.decimal_comma))


def _quoted_commas(lines: Sequence[tuple[int, tuple[str, ...]]]) -> bool:
    """Return whether cells between commas hold numbers with a decimal comma, and not thousands."""
    return any(QUOTED_COMMA.fullmatch(cell) for _, cells in lines for cell in cells if "," in cell)


def sniff(head: Head) -> Layout | None:
    """Return the layout of a table with names above its samples, or None where these lines give none."""
    names = _names_place(head)
    if names is None:
        return None
    between = [cells for _, cells in head.lines[names + 1 : head.first]]
    parts = split_titles(_padded(head.lines[names][1], head.width))
    titles, stated = [title for title, _ in parts], [unit for _, unit in parts]
    for cells in between:
        for place, cell in enumerate(_padded(cells, head.width)):
            stated[place] = cell or stated[place]
    filled = _filled(head)
    first = _padded(head.lines[head.first][1], head.width)
    days = tuple(title for title, cell in zip(titles, first, strict=True) if is_date(cell))
    empty = tuple(title for i, title in enumerate(titles) if title and i not in filled)
    named = tuple("" if title in (*days, *empty) else title for title in _different(titles))
    stamps = _stamps(dict(zip(named, first, strict=True)))
    units = {name: unit for name, unit in zip(named, stated, strict=True) if name and unit}
    units = {name: unit for name, unit in units.items() if not states_no_unit(unit)}
    units |= {name: "s" for name, first_time in stamps.items() if not is_long_count(first_time)}
    layout = Layout(
        head.path,
        head.encoding,
        head.lines[head.first][0] - 1,
        head.separator,
        head.decimal_comma,
        named,
        units,
        clocks_by_place(named) or _unnamed_clock(named, units, stamps),
        stamps=stamps,
        only_commas=head.decimal_comma,
    )
    plain = names == 0 and not between and head.lines[0][0] <= layout.header_line
    left_out = [f"column {listed(days)} holds days, left out"] if days else []
    left_out += [f"column {listed(empty)} is empty, left out"] if empty else []
    left_out += ["the first column has no name, left out"] if not titles[0] and 0 in filled else []
    if plain and not units and not left_out:
        return layout
    return replace(layout, took=(*took_from(layout, head.lines[names][0]), *left_out))


def clocks_by_place(names: Sequence[str]) -> dict[str, str]:
    """Return every channel's column of times where there are several: the one that stands before it."""
    times = [name for name in names if name and is_time_name(name) and name != "T"]  # which may be a torque
    if len(times) < 2:
        return {}
    clocks = {}
    current = times[0]
    for name in names:
        if name in times:
            current = name
        elif name:
            clocks[name] = current
    return clocks


def _stamps(first: Mapping[str, str]) -> dict[str, str]:
    """Return the columns of times that no double holds, with the first time of their kind."""
    texts = {name: cell for name, cell in first.items() if name and nanoseconds(cell) is not None}
    counts = {name: cell for name, cell in first.items() if is_time_name(name) and is_long_count(cell)}
    # columns of one kind are counted from one time: how far they are apart stays
    return {name: next(iter(kind.values())) for kind in (texts, counts) for name in kind}


def _unnamed_clock(
    names: Sequence[str], units: Mapping[str, str], stamps: Mapping[str, str]
) -> dict[str, str]:
    """Return time stamps, or a first column in a unit of time, as all times, where none is named so."""
    used = [name for name in names if name]
    if not used or any(is_time_name(name) for name in used):
        return {}
    first = unit_from_text(units.get(used[0], ""))
    clock = next(iter(stamps), used[0] if first and first.si == "s" else None)
    return {} if clock is None else {name: clock for name in used if name != clock}


def took_from(layout: Layout, names_line: int) -> tuple[str, ...]:
    """Return what the lines above the samples were taken for."""
    marks = {"\t": "tabs", ";": "semicolons", ",": "commas", SPACES: "spaces"}
    decimal = "a decimal comma" if layout.decimal_comma else "a decimal point"
    units = listed(f"{name} in {unit}" for name, unit in layout.units.items())
    sentences = [
        f"columns are separated by {marks[layout.separator]}, numbers have {decimal}",
        f"line {names_line} names the columns, samples start at line {layout.header_line + 1}",
        f"units: {units}",
    ]
    for first in dict.fromkeys(layout.stamps.values()):
        stamped = [name for name, other in layout.stamps.items() if other == first]
        hold = "holds" if len(stamped) == 1 else "hold"
        sentences.append(f"{listed(stamped)} {hold} time stamps, counted from {first}")
    if layout.clocks:
        pairs = listed(f"{name} by {clock}" for name, clock in layout.clocks.items())
        sentences.append(f"columns of times: {pairs}")
    return tuple(sentences)


def _first_samples(lines: Sequence[tuple[int, tuple[str, ...]]], comma: bool) -> int | None:
    """Return the place of the first of two lines of equal width (or a last one) that hold numbers only."""
    for place, (_, cells) in enumerate(lines):
        if not _is_samples(cells, comma):
            continue
        following = lines[place + 1][1] if place + 1 < len(lines) else None
        if following is None or (len(following) == len(cells) and _is_samples(following, comma)):
            return place
    return None


def _is_samples(cells: Sequence[str], comma: bool) -> bool:
    """Return whether a line holds numbers, days and times only."""
    filled = [cell for cell in cells if cell]
    text = [cell for cell in filled if number_from(cell, comma) is None]
    words = [cell for cell in text if reading_from(cell, comma) is None]
    return len(text) < len(filled) and all(is_date(cell) or nanoseconds(cell) is not None for cell in words)


def _names_place(head: Head) -> int | None:
    """Return the place of the line of names: next above the samples, but for lines of units between."""
    place = head.first - 1
    while place >= 0 and (_is_units(head.lines[place][1]) or _has_units(head, place)):
        place -= 1
    if place < 0:
        return None
    cells = head.lines[place][1]
    # pandas writes the index of a table into a first column without a name
    used = _filled(head) - ({0} if head.width > 1 and not cells[0] else set())
    named = {i for i, cell in enumerate(cells) if cell}
    numbers = [cell for cell in cells if number_from(cell, head.decimal_comma) is not None]
    # a line with numbers is a sample with a mistake, unless channels are called 1, 2, 3
    if numbers and (cells[0] in numbers or not all(cell.isdecimal() for cell in numbers)):
        return None
    if head.width == 1 and any(mark in cells[0] for mark in SEPARATORS):
        return None
    # LabVIEW names a column of comments that no sample need fill
    beyond = [cell for cell in cells[head.width :] if cell and cell != "Comment"]
    return place if used <= named and not beyond else None


def _filled(head: Head) -> set[int]:
    """Return the places of the columns that hold something in the first samples."""
    samples = _samples(head)
    return {i for i in range(head.width) if any(line[i : i + 1] != ("",) for line in samples)}


def _samples(head: Head) -> list[tuple[str, ...]]:
    return [cells for _, cells in head.lines[head.first : head.first + 5]]


def _is_units(cells: Sequence[str]) -> bool:
    """Return whether a line holds units: every filled cell is a unit, or states that there is none."""
    filled = [cell for cell in cells if cell]
    known = [cell for cell in filled if unit_from_text(cell) or cell.startswith("[") or states_no_unit(cell)]
    return bool(filled) and len(known) == len(filled)


def _has_units(head: Head, place: int) -> bool:
    """Return whether a line holds units, not all of them known: it stands below names of all its columns."""
    cells, above = head.lines[place][1], head.lines[place - 1][1] if place else ()
    filled = [k for k, cell in enumerate(cells) if cell]
    units = [k for k in filled if unit_from_text(cells[k]) or states_no_unit(cells[k])]
    named = [k for k, cell in enumerate(above) if cell and not unit_from_text(cell)]
    return 2 * len(units) > len(filled) and len(filled) > 1 and set(filled) <= set(named)


def _padded(cells: Sequence[str], width: int) -> list[str]:
    return [*cells, *([""] * width)][:width]


def _different(titles: Sequence[str]) -> tuple[str, ...]:
    """Return the titles; the second and later columns of times of one name are numbered."""
    names: list[str] = []
    seen: Counter[str] = Counter()
    for title in titles:
        name = f"{title} ({seen[title] + 1})" if seen[title] and is_time_name(title) else title
        names.append(name)
        seen.update(dict.fromkeys((name, name.partition(" (")[0]), 1))
    return tuple(names)
