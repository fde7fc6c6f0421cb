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
    """Tables at work on panels of blocks; `near` and `far` as `BlockTables.joined` gives them."""

    tables: BlockTables
    near: FloatArray
    far: FloatArray

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
        out = np.empty((tables.derivatives, blocks, tables.kept))
        panels = max(1, round(blocks * tables.block / max(PANEL, HALOS * 2 * tables.halo * tables.block)))
        step = -(-blocks // panels)
        with np.errstate(invalid="ignore", over="ignore"):  # the peak shows what is not finite
            found = [
                self._panel(samples, origin + first * tables.block, out[:, first : first + step])
                for first in range(0, blocks, step)
            ]
        return out.reshape(tables.derivatives, -1).T, float(np.max(found))

    def _panel(self, samples: FloatArray, origin: int, out: FloatArray) -> float:
        """Fill in consecutive blocks, the first of which begins at sample `origin`; return the peak.

        `out` has the shape (derivatives, blocks, kept in a block).
        """
        tables, count = self.tables, out.shape[1]
        block, n, halo = tables.block, tables.powers.shape[1], tables.halo
        low = origin - tables.before - halo * block
        lines = count + 2 * halo
        whole = window(samples, low, low + (lines - 1) * block + tables.window)
        parts = product(_lines(whole, block, lines, block), self.near[:block])
        if (beyond := tables.window - block) > 0:
            parts += product(_lines(whole[block:], block, lines, beyond), self.near[block:])
        # both states at once: the one that runs backward runs forward in turned time
        both = np.empty((2, len(parts), n))
        both[0], both[1] = parts[:, :n], parts[::-1, n : 2 * n]
        scan(both, tables.powers)
        reached = both[:, halo - 1 : halo - 1 + count]
        states = np.concatenate([reached[0], reached[1, ::-1]], axis=1)
        shape = count, tables.derivatives, tables.kept
        near, far = (
            parts[halo : halo + count, 2 * n :].reshape(shape),
            product(states, self.far).reshape(shape),
        )
        np.add(near.transpose(1, 0, 2), far.transpose(1, 0, 2), out=out)
        return largest(whole)


def block_product(tables: BlockTables) -> BlockProduct:
    """Return the tables as few products want them."""
    return BlockProduct(tables, *tables.joined())


def product(lines: FloatArray, table: FloatArray, out: FloatArray | None = None) -> FloatArray:
    """Return lines @ table, in any units, shapes (n, k) and (k, m), by small products of a few lines each.

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


def scan(states: FloatArray, powers: FloatArray) -> None:
    """Replace s_b by the sum over the blocks a up to b of s_a, carried to b.

    After step i every row holds the sum over 2^i blocks; the transition over twice the last power counts as
    zero.

    Parameters
    ----------
    states : array, shape (blocks, n), or several side by side, shape (several, blocks, n)
        Changed in place; in the signal's unit.
    powers : array, shape (levels, n, n)
        Transposed transition over 1, 2, 4, ... blocks.
    """
    hop = 1
    for power in powers:
        if hop >= states.shape[-2]:
            break
        states[..., hop:, :] += np.matmul(states[..., :-hop, :], power)
        hop *= 2


def _lines(samples: FloatArray, block: int, count: int, wide: int) -> FloatArray:
    """Return the first samples of blocks, shape (count, wide), of samples, shape (n,); a view of them."""
    samples = np.ascontiguousarray(samples, dtype=float)
    step = samples.itemsize
    return np.ndarray((count, wide), float, samples, strides=(block * step, step))
