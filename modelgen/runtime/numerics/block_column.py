"""BlockColumn: one column of the rows of several blocks, of which it is zero in most."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray


class BlockColumn(Sequence[FloatArray]):
    """A column of so many blocks, one array a block, shape (n,); zeros are made when they are asked for.

    A force, or an effect, is in few rows of a long chain: to look for these in all blocks, for every column,
    takes longer than to work with them.

    Attributes
    ----------
    parts : mapping of int to array
        The blocks in which it is not zero, in their order.
    """

    def __init__(self, parts: Mapping[int, FloatArray], counts: Sequence[int]) -> None:
        """Take the parts, and how many samples each block has."""
        self.parts, self._counts = dict(sorted(parts.items())), counts

    def __len__(self) -> int:
        return len(self._counts)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return tuple(self)[index]
        count = self._counts[index]  # an index beyond them ends an iteration
        part = self.parts.get(range(len(self))[index])
        return np.zeros(count) if part is None else part

    def changed(self, change: Callable[[FloatArray], FloatArray]) -> BlockColumn:
        """Return the column with every part, shape (n,), changed by what leaves zeros as they are."""
        return BlockColumn({index: change(part) for index, part in self.parts.items()}, self._counts)


def block_column(column: Sequence[FloatArray]) -> BlockColumn:
    """Return a column, one array a block, shape (n,), without its blocks of zeros."""
    if isinstance(column, BlockColumn):
        return column
    parts = {index: part for index, part in enumerate(column) if part.any()}
    return BlockColumn(parts, [len(part) for part in column])
