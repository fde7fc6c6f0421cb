"""The formats of data files by suffix, and what each needs to be opened."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from modelgen.errors import DataError
from modelgen.read_file import DATA, TEXT_DATA, check_file
from modelgen.runtime.files.hdf5 import open_hdf5
from modelgen.runtime.files.mdf import open_mdf
from modelgen.runtime.files.npz_and_mat import open_mat, open_npz
from modelgen.runtime.files.parquet import open_parquet
from modelgen.runtime.files.size_limits import check_columns
from modelgen.runtime.files.source import Source
from modelgen.runtime.files.tdms import open_tdms
from modelgen.runtime.files.text import open_text

OPENERS: dict[str, Callable[[Path], Source]] = {
    ".csv": open_text,
    ".txt": open_text,
    ".tsv": open_text,
    ".npz": open_npz,
    ".mat": open_mat,
    ".parquet": open_parquet,
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".mf4": open_mdf,
    ".mdf": open_mdf,
    ".tdms": open_tdms,
}


def open_source(path: Path) -> Source:
    """Open a data file by its suffix.

    Raises
    ------
    DataError
        When the file is absent, unreadable, or of no known format.
    """
    opener = OPENERS.get(path.suffix.lower())
    if opener is None:
        what = f"has the suffix {path.suffix!r}" if path.suffix else "has no suffix"
        raise DataError.at(str(path), what, f"give a file of one of the formats {', '.join(OPENERS)}")
    check_file(path, TEXT_DATA if opener is open_text else DATA)
    try:
        source = opener(path)
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError.at(str(path), f"cannot be read ({reason})", "check the path and the file") from error
    check_columns(path, len(source.names), source.names)
    return source
