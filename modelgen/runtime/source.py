"""Source: an opened data file, before anybody has said which of its columns are the model's channels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy.typing as npt

Columns = dict[str, npt.NDArray[Any]]


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
    """

    path: Path
    names: tuple[str, ...]
    load: Callable[[Sequence[str]], Columns]
    scalars: Mapping[str, float] = field(default_factory=dict)
    fs: float | None = None
    name: str | None = None
    tag: str | None = None
