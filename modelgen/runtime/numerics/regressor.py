"""Columns that many rows are regressed on, kept as the few that make them: samples times a mix of these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.numerics.block_column import block_column

# Rows that are weighted at a time.
PIECE = 1 << 14


@dataclass(frozen=True, eq=False)
class Regressor:
    """Columns R = `samples` M of one block of rows, shape (n, c), of which M has few lines.

    A row of a long chain has few columns of its own, and their projection on instruments, which touches all
    columns, is made of as few: it is never worked out.

    Attributes
    ----------
    samples : array, shape (n, k)
    places : array of int, shape (k,), or None
        Which lines of `mix` (or, without one, which columns of R) those of `samples` are; None for all.
    mix : array, shape (m, c), or None
        All of whose lines M has some; None where the columns of `samples` are columns of R.
    columns : int
        c.
    """

    samples: FloatArray
    places: IntArray | None
    mix: FloatArray | None
    columns: int

    def own(self, x: FloatArray) -> FloatArray:
        """Return M x, shape (k, ...), of x with the shape (c, ...)."""
        lines = slice(None) if self.places is None else self.places
        return np.asarray(x[lines] if self.mix is None else self.mix[lines] @ x)

    def spread(self, own: FloatArray) -> FloatArray:
        """Return M^T y, shape (c, ...), of y with the shape (k, ...)."""
        if self.mix is not None:
            return np.asarray((self.mix if self.places is None else self.mix[self.places]).T @ own)
        if self.places is None:
            return own
        found = np.zeros((self.columns, *own.shape[1:]))
        found[self.places] = own
        return found

    def times(self, x: FloatArray) -> FloatArray:
        """Return R x, shape (n, ...), of x with the shape (c, ...)."""
        return np.asarray(self.samples @ self.own(x))

    def across(self, rows: FloatArray) -> FloatArray:
        """Return R^T e, shape (c, ...), of rows e with the shape (n, ...)."""
        return self.spread(self.samples.T @ rows)

    def lines(self, triangle: FloatArray) -> FloatArray:
        """Return T M, shape (r, c), of what stands for the samples, T with the shape (r, k)."""
        if self.mix is None and self.places is None:
            return triangle
        return np.ascontiguousarray(self.spread(triangle.T).T)

    def dense(self) -> FloatArray:
        """Return R, shape (n, c)."""
        return self.lines(self.samples)

    def chosen(self, columns: IntArray) -> FloatArray:
        """Return some of the columns of R, shape (n, chosen)."""
        if self.mix is None and self.places is not None and np.array_equal(self.places, columns):
            return self.samples
        return self.samples @ self.own(np.eye(self.columns)[:, columns])

    def within(self, rows: slice) -> Regressor:
        """Return some of the rows."""
        return replace(self, samples=self.samples[rows])


def regressor(W: FloatArray | Regressor) -> Regressor:
    """Return an array, shape (n, c), as a regressor."""
    return W if isinstance(W, Regressor) else Regressor(W, None, None, W.shape[1])


@dataclass(frozen=True, eq=False)
class Regressors(Sequence[Regressor]):
    """The regressors of several blocks of rows, with one mix for all; fields as those of `Regressor`.

    Attributes
    ----------
    made : array, shape (first, c), or None
        What they were mixed of, from the first columns on: with instruments, these. None where nothing was.
    """

    samples: tuple[FloatArray, ...]
    places: tuple[IntArray | None, ...]
    mix: FloatArray | None
    columns: int
    made: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return tuple(self)[index]
        return Regressor(self.samples[index], self.places[index], self.mix, self.columns)

    def __iter__(self) -> Iterator[Regressor]:
        return (self[index] for index in range(len(self.samples)))

    @property
    def plain(self) -> bool:
        """Whether the samples are the columns themselves, all of them in every block."""
        return self.mix is None and all(places is None for places in self.places)

    def joined(self, extra: Sequence[Sequence[FloatArray]]) -> Regressors:
        """Return the same with further columns behind them: of each one array a block, shape (n,)."""
        more, m = len(extra), self.columns if self.mix is None else len(self.mix)
        samples, places = list(self.samples), list(self.places)
        if self.plain:
            samples = [
                np.column_stack([part, *columns]) for part, *columns in zip(samples, *extra, strict=True)
            ]
        else:  # a column of few blocks is zero in the others
            seen: list[dict[int, FloatArray]] = [{} for _ in samples]
            for place, column in enumerate(extra):
                for index, part in block_column(column).parts.items():
                    seen[index][m + place] = part
            for index, own in enumerate(places):
                before = np.arange(m) if own is None else own
                places[index] = np.concatenate([before, np.array([*seen[index]], dtype=np.int64)])
                samples[index] = np.column_stack([samples[index], *seen[index].values()])
        mix, made = (None if one is None else _bordered(one, more) for one in (self.mix, self.made))
        return Regressors(tuple(samples), tuple(places), mix, self.columns + more, made)

    def weighted(self, weights: Sequence[float]) -> Regressors:
        """Return the columns with one weight a block."""
        return replace(self, samples=tuple(w * part for w, part in zip(weights, self.samples, strict=True)))

    def dense(self) -> Regressors:
        """Return the same with all columns worked out."""
        if self.plain:
            return self
        return replace(plain_regressors(tuple(one.dense() for one in self)), made=self.made)

    def mixed(self, share: FloatArray) -> Regressors:
        """Return the columns R `share`, of which `share` has the shape (c, others)."""
        made = share if self.made is None else self.made @ share
        if self.plain:
            # columns in lines, as those of W are
            return replace(plain_regressors(tuple((share.T @ part.T).T for part in self.samples)), made=made)
        mix = share if self.mix is None else self.mix @ share
        return replace(self, mix=mix, columns=share.shape[1], made=made)

    def chosen(self, columns: Sequence[int]) -> Regressors:
        """Return some of the columns, in their order."""
        own = np.eye(self.columns)[:, list(columns)]
        if self.plain:
            found = plain_regressors(tuple(part[:, list(columns)] for part in self.samples))
            return replace(found, made=own if self.made is None else self.made @ own)
        return self.mixed(own)


def _bordered(share: FloatArray, more: int) -> FloatArray:
    """Return shares, shape (m, c), with as many further ones that are their own, (m + more, c + more)."""
    m, c = share.shape
    return np.block([[share, np.zeros((m, more))], [np.zeros((more, c)), np.eye(more)]])


def plain_regressors(samples: tuple[FloatArray, ...]) -> Regressors:
    """Return arrays with all columns, shape (n, c) a block, as regressors."""
    return Regressors(samples, (None,) * len(samples), None, samples[0].shape[1])


class WeightedPieces(Sequence[tuple[Regressor, FloatArray]]):
    """Weighted regressors, shape (n, c), and what is regressed on them, (n,), some rows at a time.

    `measured` and `weights` are one a block. Every pass weighs them anew: no copy of all is kept.
    """

    def __init__(
        self, regressors: Regressors, measured: Sequence[FloatArray], weights: Sequence[float]
    ) -> None:
        self._regressors, self._measured, self._weights = regressors, measured, weights
        self._pieces = [
            (index, slice(start, start + PIECE))
            for index, values in enumerate(measured)
            for start in range(0, max(len(values), 1), PIECE)
        ]

    def __len__(self) -> int:
        return len(self._pieces)

    def __getitem__(self, number: Any) -> Any:
        index, rows = self._pieces[number]
        weight, part = self._weights[index], self._regressors[index].within(rows)
        return replace(part, samples=weight * part.samples), weight * self._measured[index][rows]
