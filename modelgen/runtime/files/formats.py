"""The formats of data files by suffix, and what each needs to be opened."""

from __future__ import annotations

import csv
from collections.abc import Callable
from os.path import isdir
from pathlib import Path

from modelgen.errors import DataError, listed
from modelgen.read_file import DATA, TEXT_DATA, check_file
from modelgen.runtime.files.size_limits import check_columns
from modelgen.runtime.files.source import Source

TEXT_SUFFIXES = (".csv", ".txt", ".tsv")
SUFFIXES = (
    *TEXT_SUFFIXES,
    ".npz",
    ".mat",
    ".parquet",
    ".h5",
    ".hdf5",
    ".mf4",
    ".mdf",
    ".tdms",
    ".mcap",
    ".bag",
    ".db3",
    ".db3.zstd",
    ".db3.zst",
)
# of files that are packed as a whole the suffix before tells the format
PACKED = (".zstd", ".zst", ".gz", ".bz2", ".xz", ".zip")


def open_source(path: Path) -> Source:
    """Open a data file by its suffix.

    Raises
    ------
    DataError
        When the file is absent, unreadable, or of no known format.
    """
    suffix = path.suffix.lower()
    if suffix in PACKED:
        suffix = path.with_suffix("").suffix.lower() + suffix
    if suffix not in SUFFIXES:
        if isdir(path):
            held = sorted(one.name for one in path.iterdir() if one.suffix.lower() in SUFFIXES)
            remedy = f"give a file in it: {listed(held)}" if held else "give a file"
            raise DataError.at(str(path), "is a folder", remedy)
        what = f"has the suffix {suffix!r}" if suffix else "has no suffix"
        first = "unpack it, and " if path.suffix.lower() in PACKED else ""
        raise DataError.at(str(path), what, f"{first}give a file of one of the formats {', '.join(SUFFIXES)}")
    check_file(path, TEXT_DATA if suffix in TEXT_SUFFIXES else DATA)
    try:
        source = _opener(suffix)(path)
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError.at(str(path), f"cannot be read ({reason})", "check the path and the file") from error
    check_columns(path, len(source.names), source.names)
    return source


def _opener(suffix: str) -> Callable[[Path], Source]:
    """Return the function that opens a format; the readers of the other formats are not imported."""
    if suffix in TEXT_SUFFIXES:
        from modelgen.runtime.files.text import open_text

        return open_text
    if suffix in (".npz", ".mat"):
        from modelgen.runtime.files.npz_and_mat import open_mat, open_npz

        return open_npz if suffix == ".npz" else open_mat
    if suffix in (".h5", ".hdf5"):
        from modelgen.runtime.files.child_process.hdf5 import open_hdf5

        return open_hdf5
    if suffix in (".mf4", ".mdf"):
        from modelgen.runtime.files.child_process.mdf import open_mdf

        return open_mdf
    if suffix == ".mcap":
        from modelgen.runtime.files.child_process.messages import open_mcap

        return open_mcap
    if suffix == ".bag" or suffix.startswith(".db3"):
        from modelgen.runtime.files.child_process.messages import open_rosbag

        return open_rosbag
    if suffix == ".parquet":
        from modelgen.runtime.files.parquet import open_parquet

        return open_parquet
    from modelgen.runtime.files.tdms import open_tdms

    return open_tdms
