"""The scan at block rate: what every block adds to a state -> the state at the end of every block."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def carry_forward(states: FloatArray, powers: FloatArray) -> None:
    """Replace s_b by the sum over all blocks a up to b of the transition over b - a blocks times s_a.

    After step i every row holds the sum over the 2^i blocks up to its own; the transition over twice the
    last power counts as zero.

    Parameters
    ----------
    states : array, shape (blocks, n)
        Changed in place.
    powers : array, shape (levels, n, n)
        Transposed transition over 1, 2, 4, ... blocks.
    """
    hop = 1
    for power in powers:
        if hop >= len(states):
            break
        states[hop:] += states[:-hop] @ power
        hop *= 2


def carry_backward(states: FloatArray, powers: FloatArray) -> None:
    """Do the same from the last block to the first."""
    hop = 1
    for power in powers:
        if hop >= len(states):
            break
        states[:-hop] += states[hop:] @ power
        hop *= 2
