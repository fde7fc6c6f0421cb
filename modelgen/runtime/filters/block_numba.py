"""LoopBlocks: blocks of a signal through their tables by `block_loops`, which numba compiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.block_kernels import (
    LANES,
    copy_signs,
    copy_windows,
    gather_states,
    largest_bits,
    multiply,
    put,
    run,
    scan_in_turn,
)
from modelgen.runtime.filters.block_numpy import window
from modelgen.runtime.filters.block_tables import BlockTables
from modelgen.runtime.numerics.numba_support import compiled

Kernel = Callable[..., int]

# Samples worked on at a time: what is made of them stays in the cache.
PANEL = 1 << 15
# halos are worked on twice, so a panel is long against them
HALOS = 32


@dataclass(frozen=True, eq=False)
class LoopBlocks:
    """Tables at work on blocks, by `block_loops.run`.

    Attributes
    ----------
    tables : BlockTables
    near_table, far_table, hop, ends : array
        See `modelgen.runtime.filters.block_kernels.run`.
    kernel : callable
        That function, or what a compiler made of it.
    """

    tables: BlockTables
    near_table: FloatArray
    far_table: FloatArray
    hop: FloatArray
    ends: IntArray
    kernel: Kernel

    def apply(
        self, samples: FloatArray, origin: int, blocks: int, signs: bool = False
    ) -> tuple[FloatArray, float]:
        """Return the derivatives, shape (samples kept, derivatives), and the largest absolute sample.

        See `BlockProduct` in `block_numpy`.
        """
        tables = self.tables
        block, halo = tables.block, tables.halo
        low = origin - tables.before - halo * block
        whole = window(samples, low, low + (blocks + 2 * halo - 1) * block + tables.window)
        out = np.empty((tables.derivatives, blocks * tables.kept))
        panels = max(1, round(blocks / max(PANEL // block, HALOS * halo)))
        step = -(-blocks // panels)
        whole = np.ascontiguousarray(whole)
        matrices = (self.near_table, self.far_table, self.hop, self.ends)
        largest = self.kernel(whole, signs, block, halo, step, *matrices, out)
        return out.T, float(np.int64(largest).view(np.float64))


def loop_blocks(tables: BlockTables, kernel: Kernel) -> LoopBlocks:
    """Return the tables as the loops want them: derivatives side by side, states filled up to `LANES`."""
    n = tables.powers.shape[1]
    near, far = tables.joined(LANES)
    filled = len(far) // 2
    hop = np.zeros((filled, filled))
    hop[:n, :n] = tables.powers[0]
    # of states that have died away a block later none is left
    used = [np.flatnonzero(np.any(hop[:, j : j + LANES], axis=1)) for j in range(0, filled, LANES)]
    ends = [int(np.max(rows, initial=0)) + 1 for rows in used]
    return LoopBlocks(tables, near, far, hop, np.array(ends, dtype=np.int64), kernel)


def compiled_run() -> Kernel | None:
    """Return `block_loops.run`, compiled, or None without numba."""
    parts = (largest_bits, copy_windows, copy_signs, multiply, scan_in_turn, gather_states, put)
    loops: Kernel | None = compiled(run, parts)
    return loops
