"""The lines of a text file: their encoding, and how long and how wide they may be."""

from __future__ import annotations

from codecs import IncrementalDecoder, getincrementaldecoder
from collections.abc import Iterator
from pathlib import Path

from modelgen.errors import DataError
from modelgen.runtime.files.size_limits import BLOCK, MOST_COLUMNS, check_columns

SEPARATORS = "\t;,"
SNIFFED_LINES = 400  # the samples begin before this line, or the file is a plain table
SNIFFED_CHARACTERS = 4_000_000  # in wide tables less lines are enough, but for so many
LEAST_SNIFFED = 8
LONGEST_LINE = 400 * MOST_COLUMNS + BLOCK  # bytes, to within a block


def encoding_of(path: Path) -> str:
    """Return the encoding: by its mark, else UTF-8 where the file is, else Latin-1 (old instruments).

    Raises
    ------
    DataError
        When a line is too long to be one of samples.
    """
    decoder = getincrementaldecoder("utf-8")()
    encoding, line = "utf-8-sig", 0
    with path.open("rb") as file:
        if file.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            encoding = "utf-16"
        file.seek(0)
        while block := file.read(BLOCK):
            ends = max(block.rfind(b"\n"), block.rfind(b"\r"))
            line = line + len(block) if ends < 0 else len(block) - ends
            if line > LONGEST_LINE:
                what = f"has a line of more than {LONGEST_LINE} characters"
                raise DataError.at(str(path), what, "check that it is text, one line a sample")
            if encoding == "utf-8-sig" and not _decodes(decoder, block):
                encoding = "latin-1"
    return encoding if encoding != "utf-8-sig" or _decodes(decoder, b"") else "latin-1"


def _decodes(decoder: IncrementalDecoder, block: bytes) -> bool:
    """Tell whether a further part of a text, none at its end, is in the encoding."""
    try:
        decoder.decode(block, final=not block)
    except UnicodeDecodeError:
        return False
    return True


def lines_of(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Yield (number from 1, line without its end)."""
    with path.open(encoding=encoding) as file:
        for number, line in enumerate(file, start=1):
            yield number, line.rstrip("\n")


def first_lines(path: Path, encoding: str) -> list[tuple[int, str]]:
    """Return the first lines that are neither empty nor comments; none has more cells than are read."""
    found: list[tuple[int, str]] = []
    characters = 0
    for number, line in lines_of(path, encoding):
        characters += len(line)
        if number > SNIFFED_LINES or (len(found) >= LEAST_SNIFFED and characters > SNIFFED_CHARACTERS):
            break
        if line.strip() and not line.startswith("#"):
            check_columns(path, 1 + max(line.count(mark) for mark in SEPARATORS))
            if len(line) > 2 * MOST_COLUMNS:
                check_columns(path, len(line.split()))
            found.append((number, line))
    return found
