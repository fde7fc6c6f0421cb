"""What the regressors of a fit span: coordinates in it, and what lies outside of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.thresholds import SIMULATED_TOLERANCE
from modelgen.runtime.numerics.qr_triangle import joined_triangle, lines_of, tall_triangle
from modelgen.runtime.numerics.regressor import Regressors


class Spanned:
    """An orthonormal basis Q = R B of the columns of weighted regressors R.

    Of rows that have all columns it is worked out. Of others, whose Q would have a hundred times the numbers
    of R, only B is: directions that R hardly has are left out then, as they would be rounding. Q has no unit,
    rows and columns are in SI times the weights.
    """

    def __init__(self, regressors: Regressors) -> None:
        """Take what is spanned, weighted."""
        self._R, plain = regressors, regressors.plain
        self._places = [slice(None) if places is None else places for places in regressors.places]
        self._ends = np.cumsum([0, *(len(part) for part in regressors.samples)]).tolist()
        if plain:
            R = np.concatenate(regressors.samples)
        else:
            nothing = [np.zeros(len(part)) for part in regressors.samples]
            rows = [
                one.lines(lines_of(tall_triangle(one.samples, none))[:, 1:-1])
                for one, none in zip(regressors, nothing, strict=True)
            ]
            R = joined_triangle(rows)
        self.sizes = np.linalg.norm(R, axis=0)
        scale = np.where(self.sizes > 0.0, self.sizes, 1.0)
        Q, T = np.linalg.qr(R / scale) if plain else (None, R / scale)
        U, s, Vt = np.linalg.svd(T)
        least = np.finfo(float).eps * max(self._ends[-1], len(s)) if plain else SIMULATED_TOLERANCE
        kept = s > least * s[0]
        self.back = Vt[kept].T / s[kept] / scale[:, None]
        self._Q = None if Q is None else np.asarray(Q @ U[:, kept])
        # the same of the samples that R is made of
        self._mixed = self.back if regressors.mix is None else regressors.mix @ self.back
        # numbers that `across` gives
        self.width = int(kept.sum()) if plain else len(self._mixed)

    def across(self, index: int, rows: FloatArray) -> FloatArray:
        """Return what `coordinates` takes, added up over the blocks, of rows of a block, shape (n, ...)."""
        if self._Q is not None:
            return np.asarray(self._Q[self._ends[index] : self._ends[index + 1]].T @ rows)
        found = np.zeros((self.width, *rows.shape[1:]))
        found[self._places[index]] = self._R.samples[index].T @ rows
        return found

    def coordinates(self, across: FloatArray) -> FloatArray:
        """Return Q^T e, shape (rank, ...), from the sum over all blocks of what `across` gives."""
        return np.asarray(across if self._Q is not None else self._mixed.T @ across)

    def parts(self, column: FloatArray) -> Sequence[FloatArray]:
        """Return the blocks of a column, shape (r,)."""
        return list(np.split(column, self._ends[1:-1]))

    def apart(self, column: FloatArray) -> FloatArray:
        """Return a weighted column, shape (r,), without what the regressors explain of it."""
        if self._Q is not None:
            return np.asarray(column - self._Q @ (self._Q.T @ column))
        across = np.zeros(self.width)
        pieces = list(zip(self._R.samples, self._places, self.parts(column), strict=True))
        for samples, places, part in pieces:
            if part.any():
                across[places] += samples.T @ part
        own = self._mixed @ self.coordinates(across)
        return np.concatenate([part - samples @ own[places] for samples, places, part in pieces])
