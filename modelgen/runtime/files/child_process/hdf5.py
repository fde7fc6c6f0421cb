"""HDF5 files (.h5, .hdf5) and MATLAB 7.3 files (.mat), which are HDF5 -> Source; needs h5py."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modelgen.errors import DataError, listed
from modelgen.runtime.files.child_process.reader_process import ask
from modelgen.runtime.files.matrix_columns import Notation
from modelgen.runtime.files.size_limits import check_columns, check_expansion
from modelgen.runtime.files.source import Columns, Source, source_of_shapes


def open_hdf5(path: Path, notation: Notation = "python") -> Source:
    """Return the source of an HDF5 file: every numeric vector is a column, named by its path in the file.

    A matrix holds several; MATLAB (notation "matlab") stores its matrices turned over. What its cells and
    arrays of structures hold is named as in older versions: "c{2}", "log.signals(2).values".

    Attributes of the file that are single numbers count as scalars (fs, a gain), an attribute "unit" or
    "units" of a vector as its unit.

    Raises
    ------
    DataError
        When h5py is missing, the file is none, unpacks to far more than its size, or refers to other files.
    """
    found, numbers, left_out = ask("hdf5.listing", path)
    check_columns(path, len(found))
    sets = {entry["name"]: entry for entry in found}
    for column, entry in sets.items():
        if entry["elsewhere"]:
            what, remedy = "keeps its samples in another file", "export it whole, into one file"
            raise DataError.at(f"{path}: column {column}", what, remedy)
    check_expansion(path, sum(entry["bytes"] for entry in found))

    turned = notation == "matlab"

    def load(names: Sequence[str]) -> Columns:
        read = ask("hdf5.columns", path, places=[sets[name]["place"] for name in names])
        return {name: array.T if turned else array for name, array in zip(names, read, strict=True)}

    single = {name: entry["value"] for name, entry in sets.items() if entry["value"] is not None}
    return source_of_shapes(
        path,
        {name: tuple(entry["shape"][:: -1 if turned else 1]) for name, entry in sets.items()},
        {name: np.asarray(value) for name, value in (numbers | single).items()},
        load,
        notation,
        units={name: entry["unit"] for name, entry in sets.items() if entry["unit"] is not None},
        took=(f"left out: {listed(left_out)}",) if left_out else (),
    )
