"""The scan at block rate: what every block adds to a state -> the state at the end of every block.

NumPy does it for all blocks at once, by sums over 1, 2, 4, ... blocks; where numba is installed (the extra
"fast") one block after the other is quicker. The two differ by rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError

FloatArray = npt.NDArray[np.float64]
# (states running forward, states running backward, transitions) -> both changed in place
Scan = Callable[[FloatArray, FloatArray, FloatArray], None]


def choose_scan(fast: bool | None = None) -> Scan:
    """Return the compiled scan where numba works, unless `fast` says otherwise.

    Raises
    ------
    DataError
        When `fast` is true and numba is not there.
    """
    if fast is None:
        return compiled_scan() or scan_all
    if not fast:
        return scan_all
    compiled = compiled_scan()
    if compiled is None:
        what, remedy = "asks for compiled code, and numba cannot be imported", "install modelgen[fast]"
        raise DataError.at("fast", what, remedy)
    return compiled


def scan_all(forward: FloatArray, backward: FloatArray, powers: FloatArray) -> None:
    """Replace s_b by the sum over the blocks a up to b (from b on) of s_a, carried over |b - a| blocks.

    After step i every row holds the sum over 2^i blocks; the transition over twice the last power counts as
    zero.

    Parameters
    ----------
    forward, backward : array, shape (blocks, n)
        Changed in place.
    powers : array, shape (levels, n, n)
        Transposed transition over 1, 2, 4, ... blocks.
    """
    hop = 1
    for power in powers:
        if hop >= len(forward):
            break
        forward[hop:] += forward[:-hop] @ power
        backward[:-hop] += backward[hop:] @ power
        hop *= 2


def scan_in_turn(forward: Any, backward: Any, powers: Any) -> None:
    """Do the same one block after the other: loops for a compiler."""
    blocks, n = forward.shape
    power = powers[0]
    for b in range(1, blocks):
        for i in range(n):
            ahead, behind = forward[b - 1, i], backward[blocks - b, i]
            for j in range(n):
                forward[b, j] += ahead * power[i, j]
                backward[blocks - 1 - b, j] += behind * power[i, j]


@lru_cache(maxsize=1)
def compiled_scan() -> Scan | None:
    """Return `scan_in_turn`, compiled, or None; the machine code is kept where that can be written."""
    try:
        from numba import njit
    except Exception:  # absent, or broken by a package it finds beside itself: it is never needed
        return None
    compiled: Scan = njit(cache=True, nogil=True)(scan_in_turn)
    return compiled
