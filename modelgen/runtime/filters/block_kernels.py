"""Blocks of a signal through their tables, written for a compiler: what lies between two matrix products.

Without numba the functions run as they stand, only slowly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Multiplications of a product that BLAS does as it is: a larger one is copied first, and spread over threads
# that wait for each other.
SMALL_PRODUCT = 1 << 18
LANES = 4  # states are worked on four at a time, so their number is filled up with zeros
MAGNITUDE = 0x7FFFFFFFFFFFFFFF  # all bits of a float but its sign


def largest_bits(bits: Any) -> int:
    """Return the bits of the largest absolute value; those of infinity and NaN are larger than all others."""
    found = 0
    for i in range(len(bits)):
        found = max(found, bits[i] & MAGNITUDE)
    return found


def copy_windows(samples: Any, block: int, windows: Any) -> None:
    """Fill in windows, a line each, that begin a block after one another."""
    wide = windows.shape[1]
    for b in range(windows.shape[0]):
        source, target = samples[b * block : b * block + wide], windows[b]
        for p in range(wide):
            target[p] = source[p]


def copy_signs(samples: Any, block: int, windows: Any) -> None:
    """Fill in the signs of windows, -1, 0 or 1, a line each."""
    wide = windows.shape[1]
    for b in range(windows.shape[0]):
        source, target = samples[b * block : b * block + wide], windows[b]
        for p in range(wide):
            value = source[p]
            target[p] = 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


def multiply(lines: Any, table: Any, out: Any) -> None:
    """Fill in lines @ table, by small products of a few lines."""
    few = max(1, SMALL_PRODUCT // table.size)
    for first in range(0, len(lines), few):
        np.dot(lines[first : first + few], table, out[first : first + few])


def scan_in_turn(parts: Any, n: int, hop: Any, ends: Any) -> None:
    """Replace what windows add to the two states (columns 0 to 2 n) by the states behind (before) them.

    `hop` is the transposed transition over a block, zero in four columns at a time from line `ends` on: the
    sections of a cascade feel those before them only. The four sums stand apart for the compiler, which
    makes one of them.
    """
    blocks = len(parts)
    for b in range(1, blocks):
        c = blocks - 1 - b
        old, new = parts[b - 1, :n], parts[b, :n]
        old_back, new_back = parts[c + 1, n : 2 * n], parts[c, n : 2 * n]
        for q in range(len(ends)):
            j = q * LANES
            f0, f1, f2, f3 = new[j], new[j + 1], new[j + 2], new[j + 3]
            g0, g1, g2, g3 = new_back[j], new_back[j + 1], new_back[j + 2], new_back[j + 3]
            for i in range(ends[q]):
                s, t = old[i], old_back[i]
                f0 += s * hop[i, j]
                f1 += s * hop[i, j + 1]
                f2 += s * hop[i, j + 2]
                f3 += s * hop[i, j + 3]
                g0 += t * hop[i, j]
                g1 += t * hop[i, j + 1]
                g2 += t * hop[i, j + 2]
                g3 += t * hop[i, j + 3]
            new[j], new[j + 1], new[j + 2], new[j + 3] = f0, f1, f2, f3
            new_back[j], new_back[j + 1], new_back[j + 2], new_back[j + 3] = g0, g1, g2, g3


def gather_states(before: Any, behind: Any, n: int, states: Any) -> None:
    """Fill in the states that reach each block from before and from behind, shape (blocks, 2 n)."""
    for b in range(len(states)):
        for i in range(n):
            states[b, i] = before[b, i]
            states[b, n + i] = behind[b, n + i]


def put(parts: Any, far: Any, first: int, kept: int, out: Any, place: int) -> None:
    """Fill in the samples kept from `place` on, a derivative a line: what is near and what is far.

    What is near stands in the columns from `first` on.
    """
    for d in range(out.shape[0]):
        left = d * kept
        for b in range(len(far)):
            target = out[d, place + b * kept : place + (b + 1) * kept]
            near, more = parts[b, first + left : first + left + kept], far[b, left : left + kept]
            for k in range(kept):
                target[k] = near[k] + more[k]


def run(
    samples: Any,
    signs: bool,
    block: int,
    halo: int,
    step: int,
    near_table: Any,
    far_table: Any,
    hop: Any,
    ends: Any,
    out: Any,
) -> int:
    """Fill in the samples kept of consecutive blocks, panel by panel; return `largest_bits` of the samples.

    Parameters
    ----------
    samples : array, shape ((blocks + 2 * halo - 1) * block + window,)
        From the first sample of the first window of the halo on.
    signs : bool
        Whether the signs of the samples take their place.
    block, halo : int
        As of `modelgen.runtime.filters.block_tables.BlockTables`.
    step : int
        Blocks to a panel.
    near_table : array, shape (window, 2 * n + derivatives * kept)
        A window -> what it adds to both states and to the samples kept.
    far_table : array, shape (2 * n, derivatives * kept)
        Both states -> samples kept.
    hop : array, shape (n, n)
        Transposed transition over a block.
    ends : array of int, shape (n / LANES,)
        Lines of `hop` that are not zero, for every `LANES` columns.
    out : array, shape (derivatives, blocks * kept)
    """
    n, wide = hop.shape[0], near_table.shape[0]
    kept = far_table.shape[1] // out.shape[0]
    blocks = out.shape[1] // kept
    most = min(step, blocks) + 2 * halo
    copied = signs or wide > block
    windows = np.empty((most if copied else 0, wide))
    parts = np.empty((most, near_table.shape[1]))
    states, far = np.empty((most, 2 * n)), np.empty((most, far_table.shape[1]))
    bits = samples.view(np.int64)
    largest = 0
    for start in range(0, blocks, step):
        count = min(step, blocks - start)
        m = count + 2 * halo
        low = start * block
        high = low + (m - 1) * block + wide
        # one look from end to end also brings the panel into the cache
        largest = max(largest, largest_bits(bits[low:high]))
        if signs:
            copy_signs(samples[low:high], block, windows[:m])
        elif copied:
            copy_windows(samples[low:high], block, windows[:m])
        if copied:
            multiply(windows[:m], near_table, parts[:m])
        else:
            multiply(samples[low:high].reshape(m, block), near_table, parts[:m])
        scan_in_turn(parts[:m], n, hop, ends)
        gather_states(parts[halo - 1 :], parts[halo + 1 :], n, states[:count])
        multiply(states[:count], far_table, far[:count])
        put(parts[halo:], far[:count], 2 * n, kept, out, start * kept)
    return largest
