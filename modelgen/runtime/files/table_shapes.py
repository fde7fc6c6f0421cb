"""Tables of text that are not one column a channel and one line a sample: what they are, and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from modelgen.errors import DataError, listed
from modelgen.runtime.files.text_layout import cells_of, number_from
from modelgen.runtime.files.text_lines import SEPARATORS, lines_of

LEAST_ACROSS = 8  # numbers in a line: fewer may be a line of metadata
MOST_WORDS = 3  # in front of them: a channel's name, its unit, a remark
SEEN_LINES = 400  # of a list of readings: enough for one of every channel


def check_shape(path: Path, encoding: str) -> None:
    """Refuse a table on its side, and a list of readings (time, channel, value).

    Raises
    ------
    DataError
        With what the table is, and how to turn it into one that is read.
    """
    lines = (line for _, line in lines_of(path, encoding) if line.strip() and not line.startswith("#"))
    first = list(islice(lines, 2))
    if len(first) == 2 and all(_is_across(line) for line in first):
        what = "has one line a channel: the first two begin with a name, and numbers follow"
        raise DataError.at(str(path), what, "transpose it: one column a channel, one line a sample")
    separators = [mark for mark in SEPARATORS if first and first[0].count(mark) == 2]
    rows = [*first, *islice(lines, SEEN_LINES)] if separators else []
    for separator in separators:
        found = _listed_channels([cells_of(line, separator) for line in rows])
        if found is not None:
            title, channels = found
            what = f"names a channel in every line (column {title}: {listed(channels)})"
            remedy = f"write one column a channel, one line a sample (pandas: pivot(columns={title!r}, ...))"
            raise DataError.at(str(path), what, remedy)


def _is_across(line: str) -> bool:
    """Return whether a line is words and then numbers: the samples of a channel."""
    for separator in SEPARATORS:
        if line.count(separator) < LEAST_ACROSS:
            continue
        cells = cells_of(line.rstrip(f"{separator}\r "), separator)
        comma = separator != ","
        words = next((k for k, cell in enumerate(cells) if number_from(cell, comma) is not None), len(cells))
        numbers = cells[words:]
        return (
            0 < words <= MOST_WORDS
            and len(numbers) >= LEAST_ACROSS
            and all(number_from(cell, comma) is not None for cell in numbers)
        )
    return False


def _listed_channels(rows: Sequence[Sequence[str]]) -> tuple[str, list[str]] | None:
    """Return the title and the entries of the column that names channels, of times, names and values."""
    if len(rows) < LEAST_ACROSS or {len(cells) for cells in rows} != {3} or not all(rows[0]):
        return None
    titles, lines = rows[0], rows[1:]
    columns = list(zip(*lines, strict=True))
    words = [k for k, column in enumerate(columns) if all(_is_word(cell) for cell in column)]
    if len(words) != 1:
        return None
    names = columns[words[0]]
    others = [column for k, column in enumerate(columns) if k != words[0]]
    # every channel is read again and again, each once a time: states of a machine come with new times
    repeated = [column for column in others if 2 * len(set(column)) <= len(lines) + 1]
    times = any(len(set(zip(column, names, strict=True))) == len(lines) for column in repeated)
    return (titles[words[0]], list(dict.fromkeys(names))) if times else None


def _is_word(cell: str) -> bool:
    return cell[:1].isalpha() and number_from(cell, decimal_comma=False) is None  # "nan" is no word
