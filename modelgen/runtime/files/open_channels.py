"""Channels from one file that holds them all: HDF5, Parquet, MDF; read in stretches, never loaded whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import FREQUENCY_REMEDY, is_frequency, shown_number
from modelgen.read_file import STRETCHES, check_file
from modelgen.runtime.files.child_process.reader_process import ask
from modelgen.runtime.files.optional_reader import reader_library, unreadable

# (path, column, start, stop) -> samples
Reader = Callable[[Path, str, int, int], npt.NDArray[np.generic]]
# (path, columns) -> samples in each
Lengths = Callable[[Path, Sequence[str]], list[int]]


@dataclass(frozen=True, eq=False)
class FileChannels:
    """A record in a file; see `open_channels`. `columns` maps a channel to its column and factor."""

    path: Path
    columns: Mapping[str, tuple[str, float]]
    fs: float
    name: str
    n: int
    reader: Reader

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(self.columns)

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,), in SI."""
        column, factor = self.columns[channel]
        try:
            samples = self.reader(self.path, column, start, stop)
        except DataError:
            raise
        except Exception as error:  # a damaged file breaks the library in many ways
            raise unreadable(self.path, "record", error) from error
        if len(samples) != stop - start:
            what = f"ends at sample {start + len(samples)} of {self.n}"
            raise DataError.at(f"{self.path}: column {column}", what, "write the file again")
        with np.errstate(over="ignore"):  # who uses it asks how large it is
            return np.asarray(samples, dtype=float) * factor


def open_channels(
    path: str | Path, columns: Mapping[str, tuple[str, float]], fs: float, name: str | None = None
) -> FileChannels:
    """Return a record whose channels are columns of one file.

    Parameters
    ----------
    path : path
        ``.h5`` or ``.hdf5`` (columns are paths of datasets), ``.parquet``, ``.mf4`` or ``.mdf``.
    columns : mapping of str to (str, float)
        Channel key to the file's column and the factor that brings it to SI units.
    fs : float
        Sampling frequency in Hz.
    name : str, optional
        Of the record; by default the file's name without suffix.

    Raises
    ------
    DataError
        When the file is absent, damaged or of another format, or a column is absent or too short.
    """
    place = Path(path)
    if place.suffix.lower() not in FORMATS:
        what = f"has the suffix {place.suffix!r}"
        raise DataError.at(str(place), what, f"give a file of one of the formats {', '.join(FORMATS)}")
    if not is_frequency(fs):
        raise DataError.at("fs", f"is {shown_number(fs)}", FREQUENCY_REMEDY)
    check_file(place, STRETCHES)
    reader, lengths = FORMATS[place.suffix.lower()]
    names = [column for column, _ in columns.values()]
    try:
        found = lengths(place, names)
    except DataError:
        raise
    except Exception as error:  # a damaged file breaks the library in many ways
        raise unreadable(place, "record", error) from error
    if len(dict.fromkeys(found)) != 1:
        listed = ", ".join(f"{column} {length}" for column, length in zip(names, found, strict=True))
        raise DataError.at(str(place), f"columns differ in length: {listed}", "cut all to the same samples")
    return FileChannels(place, dict(columns), float(fs), name or place.stem, found[0], reader)


def _read_in_child(kind: str, path: Path, column: str, start: int, stop: int) -> npt.NDArray[np.generic]:
    """Read a stretch in a process of its own: a damaged file can crash the library."""
    return np.asarray(ask(f"{kind}.stretch", path, name=column, start=start, stop=stop)[0])


def _lengths_in_child(kind: str, path: Path, columns: Sequence[str]) -> list[int]:
    found = dict(zip(columns, ask(f"{kind}.lengths", path, names=list(columns)), strict=True))
    _require(path, columns, lambda column: found[column] is not None)
    return [found[column] for column in columns]


def _parquet_read(path: Path, column: str, start: int, stop: int) -> npt.NDArray[np.generic]:
    parquet = reader_library("pyarrow.parquet", path)
    with parquet.ParquetFile(path) as file:
        edges = np.cumsum([0] + [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)])
        first = int(np.searchsorted(edges, start, side="right")) - 1
        last = int(np.searchsorted(edges, stop, side="left"))
        table = file.read_row_groups(list(range(first, last)), columns=[column])
        return np.asarray(table.column(0).to_numpy()[start - edges[first] : stop - edges[first]])


def _parquet_lengths(path: Path, columns: Sequence[str]) -> list[int]:
    parquet = reader_library("pyarrow.parquet", path)
    with parquet.ParquetFile(path) as file:
        names = list(file.schema_arrow.names)
        _require(path, columns, names.__contains__)
        return [int(file.metadata.num_rows)] * len(columns)


def _require(path: Path, columns: Sequence[str], has: Callable[[str], bool]) -> None:
    for column in columns:
        if not has(column):
            raise DataError.at(str(path), f"has no column {column}", "check the names of the columns")


_HDF5 = partial(_read_in_child, "hdf5"), partial(_lengths_in_child, "hdf5")
_MDF = partial(_read_in_child, "mdf"), partial(_lengths_in_child, "mdf")
FORMATS: dict[str, tuple[Reader, Lengths]] = {
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".parquet": (_parquet_read, _parquet_lengths),
    ".mf4": _MDF,
    ".mdf": _MDF,
}
