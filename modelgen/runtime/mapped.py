"""Channels from NumPy's .npy files, one a channel, mapped and never loaded whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NpyChannels:
    """A record in .npy files; see `open_npy`."""

    paths: Mapping[str, Path]
    fs: float
    name: str
    n: int
    factors: Mapping[str, float] = field(default_factory=dict)

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel."""
        # mapped anew each time: pages of an open map would stay in memory until the whole file is there
        samples = np.array(_mapped(self.paths[channel])[start:stop], dtype=float)
        return samples * self.factors[channel] if channel in self.factors else samples


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
    if not 0.0 < fs < np.inf:
        raise DataError.at("fs", f"is {fs!r}", "give the sampling frequency in Hz, finite and positive")
    files = {channel: Path(path) for channel, path in paths.items()}
    lengths = {channel: len(_mapped(path)) for channel, path in files.items()}
    if len(dict.fromkeys(lengths.values())) > 1:
        listed = ", ".join(f"{channel} {length}" for channel, length in lengths.items())
        raise DataError.at("record", f"channels differ in length: {listed}", "cut all to the same samples")
    first = next(iter(files.values()))
    return NpyChannels(
        files, float(fs), name or first.parent.name, next(iter(lengths.values())), factors or {}
    )


def _mapped(path: Path) -> npt.NDArray[np.generic]:
    remedy = "write it with numpy.save, one array of real numbers in one dimension"
    try:
        array: npt.NDArray[np.generic] = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise DataError.at(str(path), f"is no readable .npy file ({error})", remedy) from error
    if not isinstance(array, np.memmap) or array.ndim != 1 or array.dtype.kind not in "iuf":
        shape = getattr(array, "shape", None)
        raise DataError.at(
            str(path), f"holds {getattr(array, 'dtype', 'something')} of shape {shape}", remedy
        )
    return array
