"""NumPy archives (.npz) and MATLAB files (.mat, .h5 within) -> Source."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, listed
from modelgen.read_file import DATA, open_file
from modelgen.runtime.files.child_process.hdf5 import open_hdf5
from modelgen.runtime.files.mat import MatFile, open_variables
from modelgen.runtime.files.mat_elements import LEFT_OUT, DamagedFile, Fields
from modelgen.runtime.files.size_limits import check_columns, check_expansion, check_zip_members
from modelgen.runtime.files.source import Columns, Source, source_of_arrays, source_of_shapes
from modelgen.runtime.files.units import states_no_unit


class _NotPlain(ValueError):
    """An archive is not one of arrays with names."""


def open_npz(path: Path) -> Source:
    """Return the source of a NumPy archive; pickled objects in it are never loaded.

    Raises
    ------
    DataError
        When the file is no archive of plain arrays, or unpacks to far more than its size.
    """
    try:
        # np.load would leave a file that it opened itself open when it is no archive
        with open_file(path, DATA) as file:
            check_zip_members(path, file)
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise _NotPlain("it holds a single array without a name")
            check_columns(path, len(archive.files))
            members = archive.zip.infolist() if archive.zip else []
            check_expansion(path, sum(member.file_size for member in members))
            arrays = {name: archive[name] for name in archive.files}
            repeated = dict.fromkeys(name for name, times in Counter(archive.files).items() if times > 1)
        foreign = next((name for name, array in arrays.items() if not isinstance(array, np.ndarray)), None)
        if foreign is not None:
            raise _NotPlain(f"its member {foreign!r} is no array")
    except (OSError, DataError):
        raise
    except Exception as error:  # a damaged file breaks the parser in many ways
        # NumPy's own words advise to trust pickled objects, and state addresses in memory
        reason = str(error) if isinstance(error, _NotPlain) else "its members are no plain arrays"
        remedy = "write it with numpy.savez, plain arrays only"
        raise DataError.at(str(path), f"is no NumPy archive ({reason})", remedy) from error
    texts = {
        name: str(array) for name, array in arrays.items() if array.ndim == 0 and array.dtype.kind == "U"
    }
    took = _repeated(repeated)
    return source_of_arrays(path, arrays, name=texts.get("name"), tag=texts.get("tag"), took=took)


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
    with open_file(path, DATA) as file:
        if b"MATLAB 7.3" in file.read(128):
            return open_hdf5(path, "matlab")
    try:
        found = open_variables(path)
        for name, variable in found.variables.items():
            if {"X", "Y"} <= set(variable.fields) and prod(variable.shape) == 1:
                traces = _dspace_traces(found.value(name))
                if traces is not None:
                    return _source_of_traces(path, name, *traces)
        return _source_of_variables(found)
    except DamagedFile as error:
        raise _no_matlab_file(path, error) from error


def _source_of_variables(file: MatFile) -> Source:
    numeric = {name: variable for name, variable in file.variables.items() if variable.is_numeric}
    within: Columns = {}
    left_out = [
        f"{name} ({variable.what})"
        for name, variable in file.variables.items()
        if variable.what in LEFT_OUT.values()
    ]
    for name, variable in file.variables.items():
        if variable.holds_others:
            try:
                within |= dict(_in_structure(name, file.value(name), within))
            except DamagedFile as error:  # the other variables may be whole
                kind = "a structure" if variable.fields else variable.what
                left_out.append(f"{name} ({kind}: {error})")
            check_columns(file.path, len(numeric) + len(within), within)

    def load(names: Sequence[str]) -> Columns:
        try:
            return {name: within[name] if name in within else file.value(name) for name in names}
        except DamagedFile as error:
            raise _no_matlab_file(file.path, error) from error

    shapes = {name: variable.shape for name, variable in numeric.items()}
    shapes |= {name: values.shape for name, values in within.items()}
    single = load([name for name, shape in shapes.items() if prod(shape) == 1])
    scalars = {name: values for name, values in single.items() if values.dtype.kind in "iuf"}
    took = [f"left out: {listed(left_out)}"] if left_out else []
    took += _repeated(file.repeated)
    return source_of_shapes(file.path, shapes, scalars, load, "matlab", took=tuple(took))


def _in_structure(name: str, value: Any, known: Collection[str]) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """Yield the arrays of a structure or cell by their places in it, "log.signals.q_m", "c{2}", of any shape.

    Of several entries each has its number, "log.signals(2).values", or its label, as Simulink writes them.
    """
    if isinstance(value, np.ndarray) and name not in known:
        yield name, value
    if isinstance(value, list):
        for k, entry in enumerate(value):
            yield from _in_structure(f"{name}{{{k + 1}}}", entry, known)
    if not isinstance(value, dict):
        return
    labels = [_text(label) for label in value.get("label", ())]
    # a label may be any text, and none
    labelled = (
        "values" in value
        and all(labels)
        and len(set(labels)) == len(labels)
        and "".join(labels).isprintable()
    )
    for part, entries in value.items():
        for k, entry in enumerate(entries):
            place = f"{name}({k + 1}).{part}" if len(entries) > 1 else f"{name}.{part}"
            yield from _in_structure(
                f"{name}.{labels[k]}" if labelled and part == "values" else place, entry, known
            )


def _repeated(names: Collection[str]) -> tuple[str, ...]:
    return (f"stored more than once, the last one counts: {listed(names)}",) if names else ()


def _no_matlab_file(path: Path, error: DamagedFile) -> DataError:
    remedy = "export it from MATLAB with save(..., '-v7')"
    return DataError.at(str(path), f"is no readable MATLAB file ({error})", remedy)


def _dspace_traces(value: Fields) -> tuple[npt.NDArray[Any], Fields] | None:
    """Return the times and traces of a structure that dSPACE writes, or None for any other one."""
    X, Y = value["X"][0], value["Y"][0]
    if not (isinstance(X, dict) and isinstance(Y, dict) and {"Name", "Data"} <= set(Y)):
        return None
    times = next(iter(X.get("Data", ())), None)
    return (times, Y) if isinstance(times, np.ndarray) else None


def _source_of_traces(path: Path, variable: str, times: npt.NDArray[Any], traces: Fields) -> Source:
    arrays: Columns = {"time": times.ravel()}
    units = {"time": "s"}
    check_columns(path, len(traces["Data"]))
    unit_texts = traces.get("Unit", [""] * len(traces["Data"]))
    for name, data, unit in zip(traces["Name"], traces["Data"], unit_texts, strict=True):
        if not isinstance(data, np.ndarray):
            continue
        # the name is a path into the model: 'Model Root/Encoder/"theta"'
        key = _text(name).strip().rpartition("/")[2].strip("\"' ") or f"trace {len(arrays)}"
        while key in arrays:
            key = f"{key} ({len(arrays)})"
        arrays[key] = data.ravel()
        if not states_no_unit(_text(unit)):
            units[key] = _text(unit)
    took = (f"a dSPACE recording in the structure {variable}: X is the time in s, Y the traces",)
    return source_of_arrays(path, arrays, units=units, took=took)


def _text(cell: Any) -> str:
    return cell if isinstance(cell, str) else ""
