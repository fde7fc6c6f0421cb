"""Anderson's acceleration of an iteration whose steps shrink by a constant share only.

Source: Walker and Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numer. Anal. 49, 2011.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray

# So many steps before the last one are combined with it.
DEPTH = 3
# A combined step is at most so many times as long as the one that it takes the place of.
LONGEST = 10.0


class AndersonSteps:
    """Steps of a fixed-point iteration x -> x + move(x), combined with those before."""

    def __init__(self) -> None:
        self._at, self._moves = list[FloatArray](), list[FloatArray]()

    def combined(self, at: FloatArray, move: FloatArray, scale: FloatArray) -> FloatArray:
        """Return the step to take from `at`, shape (n,), where the iteration would take `move`.

        `scale`, shape (n,), says what counts as a long step in each direction; zero where none counts.
        Where steps grow, what came before says nothing, and `move` is returned.
        """
        unit = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
        if self._moves and np.linalg.norm(move * unit) > np.linalg.norm(self._moves[-1] * unit):
            self._at.clear()
            self._moves.clear()
        self._at.append(at)
        self._moves.append(move)
        del self._at[: -DEPTH - 1], self._moves[: -DEPTH - 1]
        if len(self._moves) == 1:
            return move
        between, changes = np.diff(self._at, axis=0), np.diff(self._moves, axis=0)
        share = np.linalg.lstsq((changes * unit).T, move * unit)[0]
        # what the iteration holds in place stays there to the last digit
        found = np.where(scale > 0.0, move - share @ (between + changes), move)
        longest = LONGEST * np.linalg.norm(move * unit)
        fits = np.all(np.isfinite(found)) and np.linalg.norm(found * unit) <= longest
        return found if fits else move
