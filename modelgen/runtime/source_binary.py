"""NumPy archives (.npz) and MATLAB files up to version 7 (.mat) -> Source."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.source import Columns, Source

FS_NAMES = ("fs", "Fs")
BROKEN = (ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile, zlib.error)


def open_npz(path: Path) -> Source:
    """Return the source of a NumPy archive; pickled objects in it are never loaded.

    Raises
    ------
    DataError
        When the file is no archive of plain arrays.
    """
    try:
        # np.load would leave a file that it opened itself open when it is no archive
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise ValueError("it holds a single array without a name")
            arrays = {name: archive[name] for name in archive.files}
    except BROKEN as error:
        remedy = "write it with numpy.savez, plain arrays only"
        raise DataError.at(str(path), f"is no NumPy archive ({error})", remedy) from error
    texts = {
        name: str(array) for name, array in arrays.items() if array.ndim == 0 and array.dtype.kind == "U"
    }
    return _source(path, arrays, name=texts.get("name"), tag=texts.get("tag"))


def open_mat(path: Path) -> Source:
    """Return the source of a MATLAB file up to version 7; what is neither vector nor number is left out.

    Raises
    ------
    DataError
        When the file is no MATLAB file, or one of version 7.3.
    """
    from scipy.io import loadmat

    remedy = "export it from MATLAB with save(..., '-v7')"
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            raise DataError.at(str(path), "is a MATLAB 7.3 file, which is HDF5", remedy)
    try:
        # whosmat would list the variables without reading them, but fails where one is an object
        loaded = loadmat(path)
    except Exception as error:  # a damaged file breaks the parser in many ways
        raise DataError.at(str(path), f"is no readable MATLAB file ({error})", remedy) from error
    arrays = {
        name: value
        for name, value in loaded.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc" and not name.startswith("__")
    }
    return _source(path, arrays)


def _source(path: Path, arrays: Columns, name: str | None = None, tag: str | None = None) -> Source:
    vectors = {key: array.ravel() for key, array in arrays.items() if _is_vector(array.shape)}
    scalars = {
        key: float(array.item())
        for key, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "iuf"
    }

    def load(names: Sequence[str]) -> Columns:
        return {key: vectors[key] for key in names}

    fs = next((scalars[key] for key in FS_NAMES if key in scalars), None)
    return Source(path, tuple(vectors), load, scalars=scalars, fs=fs, name=name, tag=tag)


def _is_vector(shape: tuple[int, ...]) -> bool:
    """Tell whether an array of this shape is one row or one column of at least two samples."""
    return 0 not in shape and sum(length > 1 for length in shape) == 1
