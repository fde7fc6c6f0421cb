"""FusedOperator: zero-phase filters, derivatives and decimation of one signal as one linear map on blocks.

The kernel of filters and differences is a sum of decaying exponentials away from its middle. The record is
cut into blocks; within a block the samples kept are one matrix product with the kernel itself, and all that
lies farther away reaches them through two states, one that runs forward and one that runs backward. A sum
over powers of two of blocks carries the states from block to block. Only samples that are
kept are ever computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.allpass import allpass_states, responses
from modelgen.runtime.derivatives import EIGHTH_ORDER
from modelgen.runtime.scan import Scan, choose_scan
from modelgen.runtime.two_sided import Sections, kernel_reach, kernels

FloatArray = npt.NDArray[np.float64]

# Beyond its reach the response is below this share of its peak: rounding of the sum within it.
REACH_TOLERANCE = 1e-15
# The states must reproduce the kernel's tails to this share of its peak, or the operator is refused.
STATE_TOLERANCE = 1e-11
# A block of this many samples balances the product within blocks against the states between them.
BLOCK = 80
FULL_RATE_BLOCK = 32
# Samples worked on at a time: a panel and what is made of it stay in the cache.
PANEL = 1 << 16


@dataclass(frozen=True, eq=False)
class FusedOperator:
    """One signal -> its filtered derivatives at the samples kept.

    Attributes
    ----------
    factor : int
        Every factor-th sample is kept.
    derivatives : tuple of int
        Orders of the derivatives, in the order of the columns returned.
    reach : int
        Samples on each side of a kept one that are felt in it (above `REACH_TOLERANCE`).
    error : float
        Largest share of a kernel's peak by which states and kernel differ.
    block : int
        Samples in a block; the first kept one is at `lead`.
    before, after : int
        Samples beside a block that the differences reach past the states.
    gather, gather_back : array, shape (block, states)
        What the samples of a block add to the state that runs forward, and to the one that runs backward.
    powers : array, shape (levels, states, states)
        Transposed transition over 1, 2, 4, ... blocks.
    spread : array, shape (before + block + after + 2 * states, kept in a block * derivatives)
        Samples and states -> samples kept.
    scan : callable
        Carries the states from block to block.
    """

    factor: int
    derivatives: tuple[int, ...]
    reach: int
    error: float
    block: int
    lead: int
    before: int
    after: int
    gather: FloatArray
    gather_back: FloatArray
    powers: FloatArray
    spread: FloatArray
    scan: Scan

    def apply(self, samples: FloatArray, start: int, count: int) -> FloatArray:
        """Return the derivatives at the samples start, start + factor, ..., shape (count, derivatives).

        Parameters
        ----------
        samples : array, shape (n,)
            Zero outside; results within `reach` of an end feel that.
        start, count : int
            First sample kept, and how many; they may lie outside.
        """
        kept_in_block = self.block // self.factor
        out = np.empty((-(-count // kept_in_block) * kept_in_block, len(self.derivatives)))
        # halos are read twice, so a panel is long against them
        panels = max(1, round(count * self.factor / max(PANEL, 16 * self.reach)))
        blocks = -(-len(out) // (kept_in_block * panels))
        for first in range(0, len(out), blocks * kept_in_block):
            panel = out[first : first + blocks * kept_in_block]
            self._panel(samples, start + first * self.factor - self.lead, panel)
        return out[:count]

    def _panel(self, samples: FloatArray, origin: int, out: FloatArray) -> None:
        """Fill in consecutive blocks; the first begins at sample `origin`."""
        block, count, states = self.block, len(out) * self.factor // self.block, self.powers.shape[1]
        halo = -(-self.reach // block)
        first, last = origin - self.before, origin + count * block + self.after
        behind = window(samples, first - halo * block, first + (count - 1) * block)
        forward = behind.reshape(-1, block) @ self.gather
        ahead = window(samples, origin + self.after + block, last + halo * block)
        backward = ahead.reshape(-1, block) @ self.gather_back
        self.scan(forward, backward, self.powers)
        wide = block + self.before + self.after
        body = window(samples, first, last)
        near = body.reshape(count, block) if wide == block else _overlapping(body, block, wide)
        flat = out.reshape(count, -1)
        np.matmul(near, self.spread[:wide], out=flat)
        flat += forward[halo - 1 :] @ self.spread[wide : wide + states]
        flat += backward[:count] @ self.spread[wide + states :]


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
        When the response is too long, or its states would not be accurate to `STATE_TOLERANCE`.
    """
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
        raise DataError.at("filter", what, "give a higher cut-off frequency")
    table[:, middle + 1 :] = smooth  # the kernel without the rounding of its transform
    scale = fs ** np.array(orders, dtype=float)
    size = block or (FULL_RATE_BLOCK if factor == 1 else BLOCK)
    size = -(-size // factor) * factor
    lead = factor // 2
    last = lead + (size // factor - 1) * factor
    before, after = max(0, middle - lead), max(0, middle - (size - 1 - last))
    hops = _powers(A, size)
    one_sample = responses(A, b, size)
    spread = _spread(table, tails, A, orders, (factor, size, lead, middle, before, after))
    return FusedOperator(
        factor=factor,
        derivatives=orders,
        reach=kernel_reach(table, REACH_TOLERANCE),
        error=error,
        block=size,
        lead=lead,
        before=before,
        after=after,
        gather=one_sample[::-1].copy(),
        gather_back=one_sample,
        powers=hops,
        scan=choose_scan(fast),
        spread=(spread.reshape(len(spread), -1, len(orders)) * scale).reshape(len(spread), -1),
    )


def window(samples: FloatArray, start: int, stop: int) -> FloatArray:
    """Return samples[start:stop] with zeros where it lies outside; a view where it does not."""
    if start >= 0 and stop <= len(samples):
        return samples[start:stop]
    padded = np.zeros(stop - start)
    low, high = min(max(start, 0), len(samples)), max(min(stop, len(samples)), 0)
    if high > low:
        padded[low - start : high - start] = samples[low:high]
    return padded


def _overlapping(body: FloatArray, block: int, wide: int) -> FloatArray:
    """Return blocks with their margins, copied, because a matrix product wants lines that do not overlap."""
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(body, wide)[::block])


def _powers(A: FloatArray, block: int) -> FloatArray:
    """Return the transposes of A^block, A^(2 block), ... down to rounding, shape (levels, states, states)."""
    power = np.linalg.matrix_power(A, block).T
    found = [power]
    while np.linalg.norm(power := power @ power) > REACH_TOLERANCE:
        found.append(power)
    return np.stack(found)


def _spread(
    table: FloatArray,
    tails: FloatArray,
    A: FloatArray,
    orders: tuple[int, ...],
    layout: tuple[int, int, int, int, int, int],
) -> FloatArray:
    """Return the matrix from a block, its margins and both states to the samples kept, for dt = 1."""
    factor, size, lead, middle, before, after = layout
    sign = np.where(np.array(orders) % 2 == 0, 1.0, -1.0)
    kept = lead + factor * np.arange(size // factor)
    place = np.arange(-before, size + after)
    lag = kept[None, :] - place[:, None]
    near = table[:, np.abs(lag)]
    near[:, lag < 0] *= sign[:, None]
    # a sample j places beyond the forward margin is at lag kept + before + 1 + j
    ahead = [tails @ np.linalg.matrix_power(A, int(t) + before - middle) for t in kept]
    behind = [
        sign[:, None] * (tails @ np.linalg.matrix_power(A, size - 1 - int(t) + after - middle)) for t in kept
    ]
    rows = [
        near.transpose(1, 2, 0),
        np.stack(ahead).transpose(2, 0, 1),
        np.stack(behind).transpose(2, 0, 1),
    ]
    return np.concatenate(rows).reshape(-1, len(kept) * len(orders))
