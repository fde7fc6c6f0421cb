"""The lines of a text file: their encoding, and how long and how wide they may be."""

from __future__ import annotations

from codecs import IncrementalDecoder, getincrementaldecoder
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import TextIO

from modelgen.errors import DataError
from modelgen.read_file import TEXT_DATA, mostly_high, open_file, other_encoding
from modelgen.runtime.files.size_limits import BLOCK, MOST_COLUMNS, check_columns

SEPARATORS = "\t;,"
SNIFFED_LINES = 400  # the samples begin before this line, or the file is a plain table
SNIFFED_CHARACTERS = 4_000_000  # in wide tables less lines are enough, but for so many
LEAST_SNIFFED = 8
UTF_32 = (b"\xff\xfe\0\0", b"\0\0\xfe\xff")
LONGEST_LINE = 400 * MOST_COLUMNS + BLOCK  # bytes, to within a block


def encoding_of(path: Path) -> str:
    """Return the encoding: by its mark, else UTF-8 where the file is, else Latin-1 (old instruments).

    Raises
    ------
    DataError
        When the file is no text (other encodings, null bytes), or a line is too long to be one of samples.
    """
    remedy = "save the file as UTF-8 text, one line a sample"
    decoder = getincrementaldecoder("utf-8")()
    encoding, place, line = "utf-8-sig", 0, 0
    with open_file(path, TEXT_DATA) as file:
        block = file.read(BLOCK)
        marked = block.startswith((b"\xff\xfe", b"\xfe\xff")) and not block.startswith(UTF_32)
        high = mostly_high(block)
        while block:
            what = _no_text(block, marked)
            if encoding == "utf-8-sig" and not marked and not _decodes(decoder, block):
                encoding = "latin-1"
                what = what or ("is EBCDIC or no text at all" if high else None)
            if what is not None:
                raise DataError.at(f"{path}: byte {place} and following", what, remedy)
            ends = max(block.rfind(b"\n"), block.rfind(b"\r"))
            line = line + len(block) if ends < 0 else len(block) - ends
            if line > LONGEST_LINE:
                what = f"has a line of more than {LONGEST_LINE} characters"
                raise DataError.at(str(path), what, "check that it is text, one line a sample")
            place += len(block)
            block = file.read(BLOCK)
    if marked:
        return "utf-16"
    return encoding if encoding != "utf-8-sig" or _decodes(decoder, b"") else "latin-1"


def _no_text(block: bytes, marked: bool) -> str | None:
    """Return why a piece of a file is no text; one that is marked as UTF-16 has single null bytes."""
    if not marked and (what := other_encoding(block)) is not None:
        return what
    return "holds null bytes" if b"\0\0\0\0" in block else None


def _decodes(decoder: IncrementalDecoder, block: bytes) -> bool:
    """Return whether a further part of a text, none at its end, is in the encoding."""
    try:
        decoder.decode(block, final=not block)
    except UnicodeDecodeError:
        return False
    return True


def opened_text(path: Path, encoding: str) -> TextIO:
    """Return a text file opened for reading."""
    return TextIOWrapper(open_file(path, TEXT_DATA), encoding=encoding)


def lines_of(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Yield (number from 1, line without its end)."""
    with opened_text(path, encoding) as file:
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
