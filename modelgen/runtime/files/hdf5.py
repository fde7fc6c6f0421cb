"""HDF5 files (.h5, .hdf5) and MATLAB 7.3 files (.mat), which are HDF5 -> Source; needs h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.npz_and_mat import source_of_arrays
from modelgen.runtime.files.optional_reader import reader_library, unreadable
from modelgen.runtime.files.size_limits import check_expansion
from modelgen.runtime.files.source import Columns, Source

UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units")


def open_hdf5(path: Path) -> Source:
    """Return the source of an HDF5 file: every numeric vector is a column, named by its path in the file.

    Attributes of the file that are single numbers count as scalars (fs, a gain), an attribute "unit" or
    "units" of a vector as its unit.

    Raises
    ------
    DataError
        When h5py is missing, the file is none, unpacks to far more than its size, or refers to other files.
    """
    h5py = reader_library("h5py", path)
    arrays: Columns = {}
    units: dict[str, str] = {}

    def collect(name: str, item: Any) -> None:
        # MATLAB keeps the inside of its objects and cells in #refs#; texts are arrays of char there
        if name.startswith("#") or not isinstance(item, h5py.Dataset) or item.dtype.kind not in "biuf":
            return
        if item.attrs.get("MATLAB_class") in (b"char", b"logical"):
            return
        if item.external is not None or item.is_virtual:
            what, remedy = "keeps its samples in another file", "export it whole, into one file"
            raise DataError.at(f"{path}: column {name.replace('/', '.')}", what, remedy)
        check_expansion(
            path, item.size * item.dtype.itemsize + sum(array.nbytes for array in arrays.values())
        )
        arrays[name.replace("/", ".")] = np.asarray(item[()])
        unit = next((item.attrs[key] for key in UNIT_ATTRIBUTES if key in item.attrs), None)
        if unit is not None:
            units[name.replace("/", ".")] = unit.decode() if isinstance(unit, bytes) else str(unit)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(collect)
            for key, value in file.attrs.items():
                if isinstance(value, (int, float, np.integer, np.floating)):
                    arrays.setdefault(key, np.asarray(value))
    except DataError:
        raise
    except Exception as error:  # a damaged file breaks the library in many ways
        if not path.is_file():
            raise
        raise unreadable(path, "HDF5 file", error) from error
    return source_of_arrays(path, arrays, units=units)
