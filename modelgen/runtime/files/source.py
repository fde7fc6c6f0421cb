"""Source: an opened data file, before anybody has said which of its columns are the model's channels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy.typing as npt

Columns = dict[str, npt.NDArray[Any]]

# a column of this name holds times, whatever else the file says
TIME_NAMES = ("t", "time", "zeit", "timestamp", "zeitstempel", "temps", "tiempo", "x-axis", "x_value")


@dataclass(frozen=True)
class Source:
    """What a data file offers.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Its columns: vectors, not yet checked for numbers.
    load : callable
        Returns the named columns, each of shape (n,); raises DataError for one that is not numeric.
    scalars : mapping of str to float
        Single numbers stored beside the columns (a gain, a sampling frequency).
    fs : float, optional
        Sampling frequency in Hz that the file states.
    name, tag : str, optional
        Name and tag of a record that was written by modelgen.
    units : mapping of str to str
        Column to the unit the file states for it, as it is written there.
    clocks : mapping of str to str
        Column to the column of its times, where the file has several.
    took : tuple of str
        What the file was taken for: sentences for its owner to check.
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

    @cached_property
    def known(self) -> frozenset[str]:
        """The names, to ask whether one is among them."""
        return frozenset(self.names)

    @cached_property
    def clock(self) -> str | None:
        """The first column that is named as times are."""
        known = (name for name in self.names if is_time_name(name))
        return next(iter(self.clocks.values()), next(known, None))


def is_time_name(name: str) -> bool:
    """Tell whether a column of this name holds times; "time (2)" is the second one of a file."""
    base = name.partition(" (")[0].strip().strip('"').lower()
    return base in TIME_NAMES
