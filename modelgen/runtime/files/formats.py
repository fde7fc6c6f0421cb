"""The formats of data files by suffix, and what each needs to be opened."""

from __future__ import annotations

import csv
from importlib import import_module
from os.path import isdir
from pathlib import Path

from modelgen.errors import DataError, listed
from modelgen.read_file import DATA, TEXT_DATA, check_file
from modelgen.runtime.files.size_limits import check_columns
from modelgen.runtime.files.source import Source

TEXT_SUFFIXES = (".csv", ".txt", ".tsv")
BAGS = (".bag", ".db3", ".db3.zstd", ".db3.zst")
# by suffix: the module of this package that reads it, and its function
READERS = {
    **dict.fromkeys(TEXT_SUFFIXES, ("text", "open_text")),
    ".npz": ("npz_and_mat", "open_npz"),
    ".mat": ("npz_and_mat", "open_mat"),
    ".parquet": ("parquet", "open_parquet"),
    **dict.fromkeys((".h5", ".hdf5"), ("child_process.hdf5", "open_hdf5")),
    **dict.fromkeys((".mf4", ".mdf"), ("child_process.mdf", "open_mdf")),
    ".tdms": ("tdms", "open_tdms"),
    ".mcap": ("child_process.messages", "open_mcap"),
    **dict.fromkeys(BAGS, ("child_process.messages", "open_rosbag")),
}
SHEETS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
DOCUMENTS = (".json", ".jsonl", ".ndjson", ".xml", ".yaml", ".yml")
# of files that are packed as a whole the suffix before it shows the format
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
    if suffix not in READERS:
        if isdir(path):
            held = sorted(one.name for one in path.iterdir() if one.suffix.lower() in READERS)
            remedy = f"give a file in it: {listed(held)}" if held else "give a file"
            raise DataError.at(str(path), "is a folder", remedy)
        what = f"has the suffix {suffix!r}" if suffix else "has no suffix"
        first = "unpack it, and " if path.suffix.lower() in PACKED else ""
        first = "save the sheet as CSV, or " if suffix in SHEETS else first
        first = "write its fields as columns of a CSV, or " if suffix in DOCUMENTS else first
        raise DataError.at(str(path), what, f"{first}give a file of one of the formats {', '.join(READERS)}")
    check_file(path, TEXT_DATA if suffix in TEXT_SUFFIXES else DATA)
    try:
        # the readers of the other formats are not imported
        module, function = READERS[suffix]
        source: Source = getattr(import_module(f"modelgen.runtime.files.{module}"), function)(path)
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError.at(str(path), f"cannot be read ({reason})", "check the path and the file") from error
    check_columns(path, len(source.names), source.names)
    return source
