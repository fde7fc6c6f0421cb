"""BlockTables: the matrices that take a block of samples and two states to the samples kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.allpass_states import responses
from modelgen.runtime.filters.thresholds import POWER_TOLERANCE


@dataclass(frozen=True, eq=False)
class BlockTables:
    """One signal, cut into blocks, -> its filtered derivatives at the samples kept.

    A window is a block with its margins.

    Attributes
    ----------
    factor, block, lead : int
        Every factor-th sample is kept; samples in a block; place of the first one kept.
    before, after : int
        Samples before and after a block that its window covers.
    halo : int
        Blocks on each side whose samples are felt.
    derivatives : int
        How many.
    gather, gather_back : array, shape (block, states)
        What the first (last) `block` samples of a window add to the state that runs forward (backward).
    powers : array, shape (levels, states, states)
        Transposed transition over 1, 2, 4, ... blocks.
    spread : array, shape (before + block + after + 2 * states, kept in a block, derivatives)
        A window and both states -> samples kept.
    """

    factor: int
    block: int
    lead: int
    before: int
    after: int
    halo: int
    derivatives: int
    gather: FloatArray
    gather_back: FloatArray
    powers: FloatArray
    spread: FloatArray

    @property
    def window(self) -> int:
        """Samples in a window."""
        return self.before + self.block + self.after

    @property
    def kept(self) -> int:
        """Samples kept in a block."""
        return self.block // self.factor

    def joined(self, lanes: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return all products in two: of windows and of both states, derivatives side by side.

        A window gives what it adds to the states and to the samples kept, shape (window, 2 * n + derivatives
        * kept); both states the rest of these, shape (2 * n, derivatives * kept); n states, filled up with
        zeros to a multiple of `lanes`.
        """
        wide, states = self.window, self.powers.shape[1]
        n = -(-states // lanes) * lanes
        spread = self.spread.transpose(0, 2, 1).reshape(len(self.spread), -1)
        near = np.zeros((wide, 2 * n + spread.shape[1]))
        near[: self.block, :states] = self.gather
        near[wide - self.block :, n : n + states] = self.gather_back
        near[:, 2 * n :] = spread[:wide]
        far = np.zeros((2 * n, spread.shape[1]))
        far[:states], far[n : n + states] = spread[wide : wide + states], spread[wide + states :]
        return near, far


def block_tables(
    kernel: FloatArray,
    tails: FloatArray,
    states: tuple[FloatArray, FloatArray],
    derivatives: tuple[int, ...],
    reach: int,
    factor: int,
    block: int,
    middle: int,
) -> BlockTables:
    """Return the tables for a sampling interval of 1.

    Parameters
    ----------
    kernel : array, shape (derivatives, lags)
        Of filter and differences, from lag 0.
    tails : array, shape (derivatives, states)
        Kernel at lag middle + 1 + k is tails @ A^k b.
    states : (A, b)
        Of `modelgen.runtime.filters.allpass_states.allpass_states`.
    derivatives : tuple of int
        Orders of the derivatives.
    reach : int
        Lags that are felt.
    factor, block : int
        As of the tables; block is a multiple of factor.
    middle : int
        Lags up to this are no sum of exponentials.
    """
    A, b = states
    lead = factor // 2
    last = lead + block - factor
    before = max(0, middle - lead)
    after = max(0, middle - (block - 1 - last))
    signs = np.where(np.array(derivatives) % 2 == 0, 1.0, -1.0)
    kept = lead + factor * np.arange(block // factor)
    lag = kept[None, :] - np.arange(-before, block + after)[:, None]
    # samples may be kept farther apart than the kernel reaches
    reached = np.pad(kernel, ((0, 0), (0, max(0, int(np.abs(lag).max()) + 1 - kernel.shape[1]))))
    near = reached[:, np.abs(lag)]
    near[:, lag < 0] *= signs[:, None]
    # a sample j places beyond the margin before (after) is at lag kept + before + 1 + j (and alike)
    ahead = [tails @ np.linalg.matrix_power(A, int(t) + before - middle) for t in kept]
    behind = [
        signs[:, None] * (tails @ np.linalg.matrix_power(A, block - 1 - int(t) + after - middle))
        for t in kept
    ]
    near, before_all, behind_all = (
        near.transpose(1, 2, 0),
        np.stack(ahead).transpose(2, 0, 1),
        np.stack(behind).transpose(2, 0, 1),
    )
    one_sample = responses(A, b, block)
    return BlockTables(
        factor,
        block,
        lead,
        before,
        after,
        -(-reach // block),
        len(derivatives),
        one_sample[::-1].copy(),
        one_sample,
        powers_of(A, block),
        np.concatenate([near, before_all, behind_all]),
    )


def powers_of(A: FloatArray, block: int) -> FloatArray:
    """Return the transposes of A^block, A^(2 block), ... down to rounding, `block` in samples.

    A, over one sample, has shape (states, states), the result (levels, states, states).
    """
    power = np.linalg.matrix_power(A, block).T
    found = [power]
    while np.linalg.norm(power := power @ power) > POWER_TOLERANCE:
        found.append(power)
    return np.stack(found)
