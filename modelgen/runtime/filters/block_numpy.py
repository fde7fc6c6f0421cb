"""BlockProduct: blocks of a signal times their tables with NumPy only, one matrix product a panel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.block_kernels import SMALL_PRODUCT
from modelgen.runtime.filters.block_tables import BlockTables

# Samples worked on at a time: a panel and what is made of it stay in the cache.
PANEL = 1 << 16
# halos are read twice, so a panel is long against them
HALOS = 8


@dataclass(frozen=True, eq=False)
class BlockProduct:
    """Tables at work on panels of blocks."""

    tables: BlockTables

    def apply(
        self, samples: FloatArray, origin: int, blocks: int, signs: bool = False
    ) -> tuple[FloatArray, float]:
        """Return the derivatives at the samples kept of consecutive blocks, shape (kept, derivatives).

        The second value is the largest absolute value among the samples used; not finite if one of them is.

        Parameters
        ----------
        samples : array, shape (n,)
            Zero outside.
        origin : int
            First sample of the first block.
        blocks : int
        signs : bool
            Whether the signs of the samples take their place.
        """
        tables = self.tables
        samples = np.sign(samples) if signs else samples
        out = np.empty((blocks, tables.kept * tables.derivatives))
        panels = max(1, round(blocks * tables.block / max(PANEL, HALOS * 2 * tables.halo * tables.block)))
        step = -(-blocks // panels)
        with np.errstate(invalid="ignore", over="ignore"):  # the peak shows what is not finite
            found = [
                self._panel(samples, origin + first * tables.block, out[first : first + step])
                for first in range(0, blocks, step)
            ]
        return out.reshape(-1, tables.derivatives), float(np.max(found))

    def _panel(self, samples: FloatArray, origin: int, out: FloatArray) -> float:
        """Fill in consecutive blocks, the first of which begins at sample `origin`; return the peak."""
        tables = self.tables
        block, states, wide, halo = tables.block, tables.powers.shape[1], tables.window, tables.halo
        margin, inside = halo * block, len(out) * block
        whole = window(samples, origin - tables.before - margin, origin + inside + tables.after + margin)
        forward = product(whole[: margin + inside - block].reshape(-1, block), tables.gather)
        behind = whole[len(whole) - margin - inside + block :]
        backward = product(behind.reshape(-1, block), tables.gather_back)
        scan(forward, tables.powers)
        scan(backward, tables.powers, backward=True)
        body = whole[margin : len(whole) - margin]
        near = body.reshape(-1, block) if wide == block else _overlapping(body, block, wide)
        spread = tables.spread.reshape(len(tables.spread), -1)
        product(near, spread[:wide], out)
        out += product(forward[halo - 1 :], spread[wide : wide + states])
        out += product(backward[: len(out)], spread[wide + states :])
        return largest(whole)


def product(lines: FloatArray, table: FloatArray, out: FloatArray | None = None) -> FloatArray:
    """Return lines @ table, shapes (n, k) and (k, m), by small products of a few lines each.

    See `block_kernels.SMALL_PRODUCT`.
    """
    few, (length, columns) = max(1, SMALL_PRODUCT // table.size), table.shape
    if len(lines) <= few:
        return np.matmul(lines, table, out=out)
    found = np.empty((len(lines), columns)) if out is None else out
    whole = len(lines) // few * few
    pieces = lines[:whole].reshape(-1, few, length)
    np.matmul(pieces, table, out=found[:whole].reshape(-1, few, columns))
    np.matmul(lines[whole:], table, out=found[whole:])
    return found


def largest(samples: FloatArray) -> float:
    """Return the largest absolute value of samples, shape (n,); not finite if a sample is not."""
    return max(float(samples.max()), -float(samples.min()))


def window(samples: FloatArray, start: int, stop: int) -> FloatArray:
    """Return samples[start:stop], shape (stop - start,), zero outside of the array; a view where possible."""
    if start >= 0 and stop <= len(samples):
        return samples[start:stop]
    padded = np.zeros(stop - start)
    low, high = min(max(start, 0), len(samples)), max(min(stop, len(samples)), 0)
    if high > low:
        padded[low - start : high - start] = samples[low:high]
    return padded


def scan(states: FloatArray, powers: FloatArray, backward: bool = False) -> None:
    """Replace s_b by the sum over the blocks a up to b (from b on, if `backward`) of s_a, carried to b.

    After step i every row holds the sum over 2^i blocks; the transition over twice the last power counts as
    zero.

    Parameters
    ----------
    states : array, shape (blocks, n)
        Changed in place.
    powers : array, shape (levels, n, n)
        Transposed transition over 1, 2, 4, ... blocks.
    backward : bool
    """
    hop = 1
    for power in powers:
        if hop >= len(states):
            break
        later, earlier = states[hop:], states[:-hop]
        if backward:
            earlier += product(later, power)
        else:
            later += product(earlier, power)
        hop *= 2


def _overlapping(body: FloatArray, block: int, wide: int) -> FloatArray:
    """Return windows copied side by side, because a matrix product needs lines that do not overlap."""
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(body, wide)[::block])
