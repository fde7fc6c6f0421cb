"""Source: an opened data file, before its columns are assigned to the channels of a model."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.files.matrix_columns import Notation, column_of_text, matrix_columns
from modelgen.runtime.files.units import split_name, split_titles, unit_from_text

Columns = dict[str, npt.NDArray[Any]]

# a scalar of this name is the sampling frequency in Hz
FS_NAMES = ("fs", "Fs")
# one of these, in lower case, is the sampling period in s, where neither a frequency nor times are stated
PERIOD_NAMES = ("ts", "dt", "t_s", "sample_time", "sampletime", "sampling_period", "samplingperiod")
# a column of this name holds times
TIME_NAMES = ("t", "time", "zeit", "timestamp", "zeitstempel", "temps", "tiempo", "x-axis", "x_value")
WITH_UNIT = re.compile(r"(t|\w{3,})_(?:s|sec|ms|us|ns)")


@dataclass(frozen=True)
class Source:
    """The contents of a data file.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Its columns: vectors, not yet checked for numbers.
    load : callable
        Returns the named columns, each of shape (n,); raises DataError for one that is not numeric.
    scalars : mapping of str to float
        Single numbers stored with the columns (a gain, a sampling frequency).
    fs : float, optional
        Sampling frequency in Hz that the file states.
    name, tag : str, optional
        Name and tag of a record that was written by modelgen.
    units : mapping of str to str
        Column to the unit the file states for it, as it is written there; else to that in its name.
    clocks : mapping of str to str
        Column to the column of its times, where the file has several.
    took : tuple of str
        How the file was interpreted: sentences for its owner to check.
    of_matrices : frozenset of str
        Names that are columns of matrices: they are read where they are asked for by name.
    starts : mapping of str to (int or None)
        Column of dates to the ns since 1970 of its first, from which it counts; None where that is lost.
    joined : bool
        Whether its columns come from several files.
    load_numeric : callable, optional
        Returns those of the named columns that are numeric, where `load` would read the file once for each.
    """

    path: Path
    names: tuple[str, ...]
    load: Callable[[Sequence[str]], Columns]
    scalars: Mapping[str, float] = field(default_factory=dict)
    fs: float | None = None
    name: str | None = None
    tag: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    clocks: Mapping[str, str] = field(default_factory=dict)
    took: tuple[str, ...] = ()
    load_numeric: Callable[[Sequence[str]], Columns] | None = None
    of_matrices: frozenset[str] = frozenset()
    starts: Mapping[str, int | None] = field(default_factory=dict)
    joined: bool = False

    def __post_init__(self) -> None:
        named = {name: unit for name, (_, unit) in zip(self.names, split_titles(self.names), strict=True)}
        units = {name: unit for name, unit in named.items() if unit} | dict(self.units)
        object.__setattr__(self, "units", units)

    def unit_of(self, column: str, key: str = "") -> str:
        """Return the unit of a column, "" for none; a channel's own key, as of a joint "turns", has none."""
        unit = self.units.get(column, "")
        return "" if column == key and split_name(column) == (column, unit) else unit

    @cached_property
    def known(self) -> frozenset[str]:
        """The names, for fast look-up."""
        return frozenset(self.names)

    def _may_be_times(self, name: str) -> bool:
        unit = unit_from_text(self.units.get(name, ""))
        return unit is None or unit.si == "s"

    def column(self, name: str) -> str:
        """Return the column that a name means: a title may include its unit, a matrix's column is y[:,0] or
        y(:,1); the name itself where there is none.
        """
        if name in self.known:
            return name
        if split_name(name)[0] in self.known:
            return split_name(name)[0]
        place = column_of_text(name)
        written = [place.written(notation) for notation in ("python", "matlab")] if place else []
        return next((text for text in written if text in self.known), name)

    @cached_property
    def clock(self) -> str | None:
        """The first column whose name is one of times."""
        return self.clock_apart_from(())

    def clock_apart_from(self, channels: Collection[str]) -> str | None:
        """Return the first column whose name is one of times and that is none of these channels.

        "T" may be a torque: it is a column of times where there is no other one, and no sampling frequency. A
        column in a unit that is none of time holds no times.
        """
        named = [name for name in self.names if is_time_name(name) and name not in channels]
        named = [name for name in named if self._may_be_times(name)]
        sure = [name for name in named if name != "T"]
        if not sure and self.fs is None:
            sure = named
        return next(iter(self.clocks.values()), next(iter(sure), None))


def columns_of_titles(where: str, titles: Sequence[str]) -> list[tuple[str, str | None]]:
    """Return the columns and units that the titles of a table state, "theta [deg]".

    Raises
    ------
    DataError
        Where two titles are of the same column: one of the two would be lost.
    """
    found = split_titles(titles)
    twice = [column for column, times in Counter(column for column, _ in found).items() if times > 1]
    if twice:
        remedy = "give every column its own name, apart from its unit"
        raise DataError.at(where, f"two columns are named {twice[0]}", remedy)
    return found


def is_time_name(name: str) -> bool:
    """Return whether a column of this name holds times, "time_s" and "log.time" too; "time (2)" is the second
    one of a file. "T_s" and "motor.T" may be torques.
    """
    group, _, base = name.partition(" (")[0].strip().strip('"').rpartition(".")
    if group and base == "T":
        return False
    with_unit = WITH_UNIT.fullmatch(base)
    return (with_unit.group(1) if with_unit else base).lower() in TIME_NAMES


def source_of_shapes(
    path: Path,
    shapes: Mapping[str, tuple[int, ...]],
    single: Columns,
    load: Callable[[Sequence[str]], Columns],
    notation: Notation = "python",
    **facts: Any,
) -> Source:
    """Return the source of arrays of these shapes, which `load` returns; `single` are single numbers.

    A matrix is taken apart into columns named in `notation`; `facts` are further fields of the Source.
    """
    scalars = {key: float(array.item()) for key, array in single.items()}
    vectors = tuple(key for key, shape in shapes.items() if _is_vector(shape))
    matrices, said = matrix_columns(shapes, notation)
    matrices = {name: column for name, column in matrices.items() if name not in shapes}
    fs = next((scalars[key] for key in FS_NAMES if key in scalars), None)
    units = dict(facts.pop("units", None) or {})
    of = {column.matrix: split_name(column.matrix)[1] for column in matrices.values()}
    units = {name: unit for name, column in matrices.items() if (unit := of[column.matrix])} | units
    units |= {name: units[column.matrix] for name, column in matrices.items() if column.matrix in units}

    def load_columns(names: Sequence[str]) -> Columns:
        of = {name: matrices[name].matrix if name in matrices else name for name in names}
        arrays = load(tuple(dict.fromkeys(of.values())))
        return {
            name: matrices[name].of(arrays[key]) if name in matrices else arrays[key].ravel()
            for name, key in of.items()
        }

    columns = (*vectors, *matrices)
    if fs is None and not any(map(is_time_name, columns)):
        fs, of_period = _of_period(scalars)
        said = (*said, *of_period)
    facts |= {"took": (*facts.pop("took", ()), *said), "of_matrices": frozenset(matrices)}
    times = {name.rpartition(".")[0]: name for name in columns if "." in name and is_time_name(name)}
    if len(times) > 1:  # of structures or groups, each with its own
        groups = {name: name.rpartition(".")[0] for name in columns if name not in times.values()}
        facts["clocks"] = {name: times[group] for name, group in groups.items() if group in times}
    return Source(path, columns, load_columns, scalars, fs=fs, units=units, **facts)


def _of_period(scalars: Mapping[str, float]) -> tuple[float | None, tuple[str, ...]]:
    """Return the frequency in Hz of the one scalar that is named as a sampling period in s, and say so."""
    found = [key for key in scalars if key.rpartition(".")[2].lower() in PERIOD_NAMES and scalars[key] > 0.0]
    if len(found) != 1:
        return None, ()
    # no more digits than a clock carries: 0.0001 s are 10 kHz
    fs = float(f"{1.0 / scalars[found[0]]:.9g}")
    return fs, (f"{found[0]} = {scalars[found[0]]:.9g}, taken for the sampling period in s: {fs:.9g} Hz",)


def source_of_arrays(
    path: Path,
    arrays: Columns,
    name: str | None = None,
    tag: str | None = None,
    units: Mapping[str, str] | None = None,
    took: tuple[str, ...] = (),
) -> Source:
    """Return the source of named arrays: those of shape (n,), (n, 1) or (1, n) are columns, matrices hold
    several, single numbers are scalars; units as the file states them.
    """
    single = {key: array for key, array in arrays.items() if array.size == 1 and array.dtype.kind in "iuf"}
    shapes = {key: array.shape for key, array in arrays.items()}

    def load(names: Sequence[str]) -> Columns:
        return {key: arrays[key] for key in names}

    return source_of_shapes(path, shapes, single, load, name=name, tag=tag, units=units, took=took)


def _is_vector(shape: tuple[int, ...]) -> bool:
    """Return whether an array of this shape is one row or one column of at least two samples."""
    return 0 not in shape and sum(length > 1 for length in shape) == 1
