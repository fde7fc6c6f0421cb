"""FusedOperator: zero-phase filters, derivatives and decimation of one signal as one linear map on blocks.

The kernel of filters and differences is a sum of decaying exponentials away from its middle. The record is
cut into blocks; within a block the samples kept are one matrix product with the kernel itself, and all that
lies farther away reaches them through two states, one that runs forward and one that runs backward. A sum
over powers of two of blocks carries the states from block to block. Only samples that are
kept are ever computed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filters.allpass_states import allpass_states, responses
from modelgen.runtime.filters.block_numba import LoopBlocks, compiled_run, loop_blocks
from modelgen.runtime.filters.block_numpy import BlockProduct, block_product
from modelgen.runtime.filters.block_tables import block_tables
from modelgen.runtime.filters.derivatives import EIGHTH_ORDER
from modelgen.runtime.filters.thresholds import REACH_TOLERANCE, STATE_TOLERANCE
from modelgen.runtime.filters.two_sided_kernel import Sections, kernel_reach, kernels, other_cutoff
from modelgen.runtime.numerics.numba_support import wanted

# A block of this many samples balances the product within blocks against the states between them.
BLOCK = 80
FULL_RATE_BLOCK = 32


@dataclass(frozen=True, eq=False)
class FusedOperator:
    """One signal -> its filtered derivatives at the samples kept.

    Attributes
    ----------
    derivatives : tuple of int
        Orders of the derivatives, in the order of the columns returned.
    reach : int
        Samples on each side of a kept one that are felt in it (above `REACH_TOLERANCE`).
    error : float
        Largest share of a kernel's peak by which states and kernel differ.
    blocks : BlockProduct or LoopBlocks
        The tables, and the code that uses them.
    """

    derivatives: tuple[int, ...]
    reach: int
    error: float
    blocks: BlockProduct | LoopBlocks

    @property
    def factor(self) -> int:
        """Every factor-th sample is kept."""
        return self.blocks.tables.factor

    @property
    def block(self) -> int:
        """Samples in a block."""
        return self.blocks.tables.block

    @property
    def margins(self) -> tuple[int, int]:
        """Samples before the first and behind the last one kept that `apply` looks at: whole blocks."""
        tables = self.blocks.tables
        halo = tables.halo * tables.block
        return tables.lead + tables.before + halo, tables.block + tables.after + halo

    def apply(self, samples: FloatArray, start: int, count: int, signs: bool = False) -> FloatArray:
        """Return the derivatives at the samples start, start + factor, ..., shape (count, derivatives).

        Parameters
        ----------
        samples : array, shape (n,)
            Zero outside, which is felt within `reach` of an end; no copy is made with `margins` around
            those kept.
        start, count : int
            First sample kept, and how many; they may lie outside.
        signs : bool
            Whether the signs of the samples take their place.
        """
        return self.checked(samples, start, count, signs)[0]

    def checked(
        self, samples: FloatArray, start: int, count: int, signs: bool = False
    ) -> tuple[FloatArray, float]:
        """Return what `apply` returns, shape (count, derivatives), and the largest absolute sample used.

        The latter is not finite if a sample is not.
        """
        tables = self.blocks.tables
        found, largest = self.blocks.apply(samples, start - tables.lead, -(-count // tables.kept), signs)
        return found[:count], largest


@lru_cache(maxsize=128)
def fused_operator(
    sos: Sections,
    fs: float,
    derivatives: tuple[int, ...] = (0,),
    factor: int = 1,
    stencil: tuple[float, ...] = EIGHTH_ORDER,
    block: int | None = None,
    fast: bool | None = None,
) -> FusedOperator:
    """Return the operator of a cascade of zero-phase sections with central differences and decimation.

    Parameters
    ----------
    sos : tuple of sections
        Second-order sections of one pass (b0, b1, b2, a0, a1, a2 each); of several filters, one after the
        other. Every section is run forward and backward.
    fs : float
        Sampling frequency in Hz.
    derivatives : tuple of int
        Orders of the derivatives to be returned.
    factor : int
        Every factor-th sample is kept; nothing is filtered for it unless `sos` does.
    stencil : tuple of float
        c_1, c_2, ... of the central difference f'(0) = fs * sum c_k (f(k) - f(-k)), applied once per order.
    block : int, optional
        Samples in a block (rounded up to a multiple of `factor`); changes the speed only.
    fast : bool, optional
        Whether to use compiled code; by default wherever numba is installed.

    Raises
    ------
    DataError
        When the response is too long, or its states would not be accurate to `STATE_TOLERANCE`; when `fast`
        is true and numba cannot be imported.
    """
    loops = None if fast is False else wanted(fast, compiled_run())
    orders = derivatives
    table = kernels(np.asarray(sos, dtype=float), orders, stencil)
    A, b = allpass_states(np.asarray(sos, dtype=float))
    middle = len(stencil) * max(orders)
    phi = responses(A, b, table.shape[1] - middle - 1)
    tails = table[:, middle + 1 :] @ phi
    smooth = tails @ phi.T
    peak = np.max(np.abs(table), axis=1, keepdims=True)
    error = float(np.max(np.abs(table[:, middle + 1 :] - smooth) / peak))
    if error > STATE_TOLERANCE:
        what = f"has poles whose states are accurate to {error:.1g} of its response only"
        raise DataError.at("filter", what, other_cutoff(np.asarray(sos, dtype=float)))
    table[:, middle + 1 :] = smooth  # the kernel without the rounding of its transform
    reach = kernel_reach(table, REACH_TOLERANCE)
    size = block or (FULL_RATE_BLOCK if factor == 1 else BLOCK)
    size = -(-size // factor) * factor
    tables = block_tables(table, tails, (A, b), orders, reach, factor, size, middle)
    tables = replace(tables, spread=tables.spread * fs ** np.array(orders, dtype=float))
    blocks = block_product(tables) if loops is None else loop_blocks(tables, loops)
    return FusedOperator(orders, reach, error, blocks)
