"""NumPy archives (.npz) and MATLAB files (.mat, .h5 within) -> Source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.size_limits import check_mat, check_zip
from modelgen.runtime.files.source import Columns, Source
from modelgen.runtime.files.units import states_no_unit

FS_NAMES = ("fs", "Fs")


def open_npz(path: Path) -> Source:
    """Return the source of a NumPy archive; pickled objects in it are never loaded.

    Raises
    ------
    DataError
        When the file is no archive of plain arrays, or unpacks to far more than its size.
    """
    try:
        check_zip(path)
        # np.load would leave a file that it opened itself open when it is no archive
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise ValueError("it holds a single array without a name")
            arrays = {name: archive[name] for name in archive.files}
        foreign = next((name for name, array in arrays.items() if not isinstance(array, np.ndarray)), None)
        if foreign is not None:
            raise ValueError(f"its member {foreign!r} is no array")
    except (OSError, DataError):
        raise
    except Exception as error:  # a damaged file breaks the parser in many ways
        remedy = "write it with numpy.savez, plain arrays only"
        raise DataError.at(str(path), f"is no NumPy archive ({error})", remedy) from error
    texts = {
        name: str(array) for name, array in arrays.items() if array.ndim == 0 and array.dtype.kind == "U"
    }
    return source_of_arrays(path, arrays, name=texts.get("name"), tag=texts.get("tag"))


def open_mat(path: Path) -> Source:
    """Return the source of a MATLAB file; what is neither vector nor number is left out.

    A structure with X and Y, as dSPACE ControlDesk writes it, becomes one column a trace. Version 7.3 is HDF5
    and read as such.

    Raises
    ------
    DataError
        When the file is no MATLAB file, unpacks to far more than its size, or h5py is missing for one of
        version 7.3.
    """
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            from modelgen.runtime.files.hdf5 import open_hdf5

            return open_hdf5(path)
    from scipy.io import loadmat

    try:
        check_mat(path)
        # whosmat would list the variables without reading them, but fails where one is an object
        loaded = loadmat(path)
    except DataError:
        raise
    except Exception as error:  # a damaged file breaks the parser in many ways
        remedy = "export it from MATLAB with save(..., '-v7')"
        raise DataError.at(str(path), f"is no readable MATLAB file ({error})", remedy) from error
    variables = {name: value for name, value in loaded.items() if not name.startswith("__")}
    for name, value in variables.items():
        traces = _dspace_traces(value)
        if traces is not None:
            return _source_of_traces(path, name, *traces)
    arrays = {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc"
    }
    return source_of_arrays(path, arrays)


def source_of_arrays(
    path: Path,
    arrays: Columns,
    name: str | None = None,
    tag: str | None = None,
    units: Mapping[str, str] | None = None,
    took: tuple[str, ...] = (),
) -> Source:
    """Return the source of named arrays: vectors are columns, single numbers are scalars."""
    vectors = {key: array.ravel() for key, array in arrays.items() if _is_vector(array.shape)}
    scalars = {
        key: float(array.item())
        for key, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "iuf"
    }

    def load(names: Sequence[str]) -> Columns:
        return {key: vectors[key] for key in names}

    fs = next((scalars[key] for key in FS_NAMES if key in scalars), None)
    return Source(
        path, tuple(vectors), load, scalars, fs=fs, name=name, tag=tag, units=units or {}, took=took
    )


def _is_vector(shape: tuple[int, ...]) -> bool:
    """Tell whether an array of this shape is one row or one column of at least two samples."""
    return 0 not in shape and sum(length > 1 for length in shape) == 1


def _dspace_traces(value: Any) -> tuple[Any, Any] | None:
    """Return the X and Y of a structure that dSPACE writes, or None for any other variable."""
    if not isinstance(value, np.ndarray) or value.dtype.names is None or value.size != 1:
        return None
    fields = value.ravel()[0]
    if not {"X", "Y"} <= set(value.dtype.names):
        return None
    X, Y = fields["X"], fields["Y"]
    kept = isinstance(X, np.ndarray) and isinstance(Y, np.ndarray) and X.dtype.names and Y.dtype.names
    return (X.ravel(), Y.ravel()) if kept and {"Name", "Data"} <= set(Y.dtype.names) else None


def _source_of_traces(path: Path, variable: str, X: Any, Y: Any) -> Source:
    arrays: Columns = {"time": np.asarray(X[0]["Data"]).ravel()}
    units = {"time": "s"}
    for trace in Y:
        # the name is a path into the model: 'Model Root/Encoder/"theta"'
        key = _text(trace["Name"]).strip().rpartition("/")[2].strip("\"' ") or f"trace {len(arrays)}"
        key = key if key not in arrays else f"{key} ({len(arrays)})"
        arrays[key] = np.asarray(trace["Data"]).ravel()
        unit = _text(trace["Unit"]) if "Unit" in Y.dtype.names else ""
        if not states_no_unit(unit):
            units[key] = unit
    took = (f"a dSPACE recording in the structure {variable}: X is the time in s, Y the traces",)
    return source_of_arrays(path, arrays, units=units, took=took)


def _text(cell: Any) -> str:
    return "".join(str(part) for part in np.asarray(cell).ravel())
