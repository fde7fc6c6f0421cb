"""Matrices of a file as columns: y[:,0] counts from 0 as Python does, y(:,1) from 1 as MATLAB does.

The brackets say who counts, so that both name the same column in every format. Samples run along the longer
side: of a matrix that lies on its side the columns are y[0,:], y[1,:] and so on.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy.typing as npt

from modelgen.errors import listed
from modelgen.runtime.files.size_limits import MOST_COLUMNS

Notation = Literal["python", "matlab"]
MOST_SIDE = 100  # of the shorter side: what has more is a picture or a map, not a recording
_NUMBER = r"\s*(:|[0-9]{1,6})\s*"
_INDEX = re.compile(rf"(.+?)\s*(?:\[{_NUMBER},{_NUMBER}\]|\({_NUMBER},{_NUMBER}\))")


@dataclass(frozen=True)
class MatrixColumn:
    """Column (or row, where samples lie along rows) `index`, from 0, of a matrix."""

    matrix: str
    index: int
    by_row: bool

    def of(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return its samples, shape (n,)."""
        return values[self.index, :] if self.by_row else values[:, self.index]

    def written(self, notation: Notation) -> str:
        """Return its name as Python or MATLAB writes it."""
        index = str(self.index + (notation == "matlab"))
        place = f"{index},:" if self.by_row else f":,{index}"
        return f"{self.matrix}({place})" if notation == "matlab" else f"{self.matrix}[{place}]"


def column_of_text(text: str) -> MatrixColumn | None:
    """Return what "y[:,1]" or "y(:,2)" means, or None for a text that is no such place."""
    found = _INDEX.fullmatch(text.strip())
    if found is None:
        return None
    name, *places = found.groups()
    row, column = places[:2] if places[0] else places[2:]
    if (row == ":") == (column == ":"):
        return None
    index = int(row if column == ":" else column) - (places[0] is None)
    return MatrixColumn(name, index, column == ":") if index >= 0 else None


def matrix_columns(
    shapes: Mapping[str, tuple[int, ...]], notation: Notation
) -> tuple[dict[str, MatrixColumn], tuple[str, ...]]:
    """Return the columns of the matrices among arrays of these shapes, by name, and what to say of them."""
    found: dict[str, MatrixColumn] = {}
    said, left_out = [], []
    for name, shape in shapes.items():
        sides = [length for length in shape if length != 1]
        if len(sides) < 2 or 0 in sides:
            continue
        if len(shape) > 2 or min(sides) > MOST_SIDE or len(shapes) + len(found) + min(sides) > MOST_COLUMNS:
            left_out.append(f"{name} ({' x '.join(map(str, shape))})")
            continue
        by_row = shape[1] > shape[0]
        columns = [MatrixColumn(name, index, by_row) for index in range(min(shape))]
        found |= {column.written(notation): column for column in columns}
        said.append(_said(columns, max(shape), notation))
    if left_out:
        said.append(f"left out, no matrices of at most {MOST_SIDE} columns: {listed(left_out)}")
    return found, tuple(said)


def _said(columns: list[MatrixColumn], samples: int, notation: Notation) -> str:
    python, matlab = (columns[0].written(kind) for kind in ("python", "matlab"))
    names = f"{columns[0].written(notation)} to {columns[-1].written(notation)}"
    what = f"{columns[0].matrix} is a matrix, taken as {len(columns)} columns of {samples} samples, {names}"
    return f"{what}; {matlab}, as MATLAB counts, is {python}, as Python counts"
