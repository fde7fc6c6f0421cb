"""One pass of a recursive filter over a whole signal, in blocks: matrix products in place of a loop.

The state runs from block to block in the orthonormal basis of `allpass_states`, so that no cut-off costs
digits; within a block the samples are a product with the filter's response.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.allpass_states import allpass_states, responses
from modelgen.runtime.filters.block_numpy import product, scan
from modelgen.runtime.filters.block_tables import powers_of
from modelgen.runtime.filters.two_sided_kernel import Sections, is_tabled, table_length

BLOCK = 64


@dataclass(frozen=True, eq=False)
class OnePass:
    """The tables of a filter: a block and the state before it -> the block filtered, and the state behind.

    Attributes
    ----------
    within : array, shape (BLOCK, BLOCK)
    gather : array, shape (BLOCK, states)
    powers : array, shape (levels, states, states)
        Transposed transition over 1, 2, 4, ... blocks.
    spread : array, shape (states, BLOCK)
    at_zero : float
        Gain at 0 Hz.
    """

    within: FloatArray
    gather: FloatArray
    powers: FloatArray
    spread: FloatArray
    at_zero: float

    def apply(self, samples: FloatArray, steady: bool = False) -> FloatArray:
        """Return samples filtered, shape (n,); before them all was zero, or like the first one (`steady`)."""
        if steady:
            return np.asarray(self.apply(samples - samples[0]) + self.at_zero * samples[0])
        blocks = -(-len(samples) // BLOCK)
        padded = np.zeros(blocks * BLOCK)
        padded[: len(samples)] = samples
        lines = padded.reshape(blocks, BLOCK)
        found = product(lines, self.within)
        if blocks > 1:
            states = product(lines[:-1], self.gather)
            scan(states, self.powers)
            found[1:] += product(states, self.spread)
        return found.reshape(-1)[: len(samples)]


@lru_cache(maxsize=64)
def one_pass(sos: Sections) -> OnePass:
    """Return the tables of stable second-order sections in cascade (b0, b1, b2, a0, a1, a2 each).

    Raises
    ------
    DataError
        When the response takes more than half a million samples to end.
    """
    A, b = allpass_states(np.asarray(sos, dtype=float))
    response = _response(sos)
    # the states' own responses are orthonormal: the response after the first sample in that basis
    c = response[1:] @ responses(A, b, len(response) - 1)
    ahead = responses(A.T, c, BLOCK)
    first = np.concatenate([response[:1], ahead[: BLOCK - 1] @ b])
    lag = np.arange(BLOCK)[None, :] - np.arange(BLOCK)[:, None]
    within = np.where(lag >= 0, first[np.abs(lag)], 0.0)
    gather = responses(A, b, BLOCK)[::-1].copy()
    at_zero = float(np.prod([(b0 + b1 + b2) / ((a0 + a1) + a2) for b0, b1, b2, a0, a1, a2 in sos]))
    return OnePass(within, gather, powers_of(A, BLOCK), np.ascontiguousarray(ahead.T), at_zero)


def one_pole(pole: float) -> OnePass:
    """Return the tables of y[k] = pole y[k - 1] + x[k], however slowly that ends."""
    lag = np.arange(BLOCK)[None, :] - np.arange(BLOCK)[:, None]
    within = np.where(lag >= 0, pole ** np.abs(lag), 0.0)
    ahead = pole ** np.arange(1.0, BLOCK + 1.0)
    powers = powers_of(np.array([[pole]]), BLOCK)
    return OnePass(within, within[:, -1:].copy(), powers, ahead[None, :], 1.0 / (1.0 - pole))


def forward_and_backward(sos: Sections, samples: FloatArray, mirrored: int) -> FloatArray:
    """Filter samples, shape (n,), forward and backward, both ends continued by so many of their odd mirror.

    Beyond these each pass takes the signal as constant. A response that is too long for a table is run sample
    by sample.
    """
    if not is_tabled(sos):
        from scipy.signal import sosfiltfilt

        padding = {"padtype": "odd", "padlen": mirrored} if mirrored else {"padtype": None}
        return np.asarray(sosfiltfilt(np.asarray(sos), samples, **padding), dtype=float)
    before = 2.0 * samples[0] - samples[mirrored:0:-1]
    behind = 2.0 * samples[-1] - samples[-2 : -mirrored - 2 : -1]
    tables = one_pass(sos)
    forward = tables.apply(np.concatenate([before, samples, behind]), steady=True)
    both = tables.apply(forward[::-1], steady=True)[::-1]
    return both[mirrored : mirrored + len(samples)]


def _response(sos: Sections) -> FloatArray:
    """Return the response to one sample, until it has ended."""
    n = table_length(np.asarray(sos, dtype=float))
    omega = np.asarray(np.arange(n // 2 + 1) * (2.0 * np.pi / n), dtype=float)
    half_sine = np.asarray(np.sin(0.5 * omega) ** 2)
    gain: ComplexArray = np.ones(len(omega), dtype=complex)
    for b0, b1, b2, a0, a1, a2 in sos:
        gain = gain * _turned(b0, b1, b2, half_sine, omega) / _turned(a0, a1, a2, half_sine, omega)
    return np.asarray(np.fft.irfft(gain, n)[: n // 2])


def _turned(c0: float, c1: float, c2: float, half_sine: FloatArray, omega: FloatArray) -> ComplexArray:
    """Return (c0 + c1 z^-1 + c2 z^-2) z on the unit circle; its real part keeps its digits near 0 Hz."""
    real = ((c0 + c1) + c2) - 2.0 * (c0 + c2) * half_sine
    return np.asarray(real + 1j * (c0 - c2) * np.sin(omega))
