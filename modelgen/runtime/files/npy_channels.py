"""Channels from NumPy's .npy files, one a channel, mapped and never loaded whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import FREQUENCY_REMEDY, is_frequency, shown_number
from modelgen.read_file import STRETCHES, check_file, open_file


@dataclass(frozen=True)
class NpyColumn:
    """Where the samples of a channel stand: n of a type, from a byte of a file on."""

    path: Path
    dtype: np.dtype[np.generic]
    offset: int
    n: int

    def read(self, start: int, stop: int) -> FloatArray:
        """Return samples start to stop as float, shape (stop - start,), in SI.

        The file is mapped anew each time: pages of an open map would stay in memory until the whole file is
        there.

        Raises
        ------
        DataError
            When the file cannot be read any more, or has become shorter.
        """
        try:
            with (
                open_file(self.path, STRETCHES) as file,
                mmap(file.fileno(), 0, access=ACCESS_READ) as mapped,
            ):
                place = self.offset + start * self.dtype.itemsize
                samples = np.frombuffer(mapped, self.dtype, stop - start, place)
                copied = samples.astype(np.float64)
                del samples  # a map that is looked at cannot be closed
                return copied
        except (OSError, ValueError) as error:
            raise unreadable(self.path, str(error)) from error


@dataclass(frozen=True, eq=False)
class NpyChannels:
    """A record in .npy files; see `open_npy`."""

    columns: Mapping[str, NpyColumn]
    fs: float
    name: str
    n: int
    factors: Mapping[str, float] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(self.columns)

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,), in SI."""
        samples = self.columns[channel].read(start, stop)
        if channel in self.factors:
            with np.errstate(over="ignore"):  # who uses it asks how large it is
                samples *= self.factors[channel]
        return samples


def open_npy(
    paths: Mapping[str, str | Path],
    fs: float,
    name: str | None = None,
    factors: Mapping[str, float] | None = None,
) -> NpyChannels:
    """Return a record whose channels are .npy files of one dimension.

    Parameters
    ----------
    paths : mapping of str to path
        Channel key to file.
    fs : float
        Sampling frequency in Hz.
    name : str, optional
        Of the record; by default that of the first file's folder.
    factors : mapping of str to float, optional
        What a channel is multiplied by, to bring it to SI units.

    Raises
    ------
    DataError
        When a file is absent, holds no real numbers in one dimension, or is not as long as the others.
    """
    if not paths:
        raise DataError.at("record", "has no channels", "give one .npy file a channel")
    if not is_frequency(fs):
        raise DataError.at("fs", f"is {shown_number(fs)}", FREQUENCY_REMEDY)
    columns = {channel: _column(Path(path)) for channel, path in paths.items()}
    if len(dict.fromkeys(column.n for column in columns.values())) > 1:
        listed = ", ".join(f"{channel} {column.n}" for channel, column in columns.items())
        raise DataError.at("record", f"channels differ in length: {listed}", "cut all to the same samples")
    first = next(iter(columns.values()))
    return NpyChannels(columns, float(fs), name or first.path.parent.name, first.n, factors or {})


def unreadable(path: Path, why: str) -> DataError:
    """Return the error of a file that is not what it should be."""
    remedy = "write it with numpy.save, one array of real numbers in one dimension"
    return DataError.at(str(path), f"is no readable .npy file ({why})", remedy)


def _column(path: Path) -> NpyColumn:
    check_file(path, STRETCHES)
    try:
        array: npt.NDArray[np.generic] = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise unreadable(path, str(error)) from error
    if not isinstance(array, np.memmap) or array.ndim != 1 or array.dtype.kind not in "iuf":
        shape = getattr(array, "shape", None)
        raise unreadable(path, f"it holds {getattr(array, 'dtype', 'something')} of shape {shape}")
    return NpyColumn(path, array.dtype, array.offset, len(array))
