"""Iterations that go round: what jumps from sample to sample may hold them in a cycle for ever."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.anderson import DEPTH

# Cycles of so many rounds at most are looked for. They are told where the whole memory of an iteration is the
# same again: the steps that are combined, and one more.
LONGEST_CYCLE, MEMORY = 8, DEPTH + 2
# Places are the same that differ by less than this share of what counts as a long step.
SAME_SHARE = 0.01


class Passed:
    """The last places of an iteration."""

    def __init__(self) -> None:
        self._at = list[FloatArray]()

    def again(self, at: FloatArray, scale: FloatArray) -> bool:
        """Tell whether `at`, shape (n,), and the places before it, were passed in this order some rounds ago.

        `scale`, shape (n,), is what counts as a long step in each direction.
        """
        self._at.append(at)
        del self._at[: -LONGEST_CYCLE - MEMORY]
        last = np.array(self._at[-MEMORY:])
        rounds = range(2, min(LONGEST_CYCLE, len(self._at) - MEMORY) + 1)
        return any(
            bool(np.all(np.abs(last - np.array(self._at[-MEMORY - back : -back])) <= SAME_SHARE * scale))
            for back in rounds
        )
