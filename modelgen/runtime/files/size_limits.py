"""How large a data file may be: one that unpacks to gigabytes, or holds too many columns, is refused."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

from modelgen.errors import DataError
from modelgen.read_file import ALWAYS_FINE, LARGEST_RATIO

ZIP_MEMBER = b"PK\x01\x02"  # in front of every member in the table of an archive
BLOCK = 1_000_000  # bytes
LONGEST_NAME = 1000  # characters of a column's name
MOST_COLUMNS = 10_000  # of a file (variables, members, data sets, channels)


def check_expansion(path: Path, unpacked: int) -> None:
    """Refuse a file that unpacks to so many bytes.

    Raises
    ------
    DataError
        When that is more than any record needs and more than a hundred times the file itself.
    """
    packed = path.stat().st_size
    if unpacked > ALWAYS_FINE and unpacked > LARGEST_RATIO * packed:
        what = f"unpacks from {packed} bytes to {unpacked / 1e6:.6g} MB or more"
        raise DataError.at(str(path), what, "check where the file comes from, or write it uncompressed")


def check_columns(path: Path, count: int, names: Iterable[str] = ()) -> None:
    """Refuse a file of so many columns, or of columns with such names, before they are listed.

    Raises
    ------
    DataError
        When a person can no longer mean them all.
    """
    longest = max(map(len, names), default=0)
    if longest > LONGEST_NAME:
        what = f"names a column with {longest} characters, at most {LONGEST_NAME} are read"
        raise DataError.at(
            str(path), what, "check that it is a file of measured samples, or rename the column"
        )
    if count > MOST_COLUMNS:
        what = f"holds {count} columns or more, at most {MOST_COLUMNS} are read"
        raise DataError.at(
            str(path), what, "export the columns that the model needs into a file of their own"
        )


def check_zip_members(path: Path, file: BinaryIO) -> None:
    """Refuse a zip archive by its number of members, before its table of them is read; other files pass.

    The table stands at the end. Where it takes so many bytes that not all its members are counted here, it is
    read, which takes no more than a second, and counted then.
    """
    count, before = 0, b""
    file.seek(max(0, path.stat().st_size - 32 * BLOCK))
    while block := file.read(BLOCK):
        # a mark may lie across two blocks
        count += (before[-3:] + block).count(ZIP_MEMBER)
        check_columns(path, count)
        before = block
    file.seek(0)
