"""Noise of a channel in front of lines that are nonlinear in it: its derivatives, and positions that lag.

Rows follow the delay that dampers give deflections exactly. At samples that do not follow each other it is a
series in lag * s, which holds for motion, and diverges beyond 1 / (2 pi lag), far below where the wide
low-pass in front of the rows ends: of noise up there it makes many times what is left of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.noise_spectrum import low_pass
from modelgen.runtime.model.arm_kernel import Kernel, Read
from modelgen.runtime.model.deflected_kernel import DeflectedKernel, GivingRow, without_sought
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.thresholds import NOISE_LINES


@dataclass(frozen=True, eq=False)
class NoiseInFront:
    """Derivatives of a channel's noise behind the wide low-pass, and what they add to positions that lag.

    Attributes
    ----------
    late : tuple of (str, int)
        The positions, by channel and order; there are none where no position is given (`beyond_series`).
    rates : array, shape (orders + late, lines)
        Each per unit of the noise, by frequency.
    power : array, shape (lines,)
        Of the noise in each line, in its unit squared.
    behind : array, shape (lines + 1,)
        Gain in power of the low-pass behind lines, at the multiples of a line's width.
    """

    late: tuple[Read, ...]
    rates: ComplexArray
    power: FloatArray
    behind: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """That of all of them, shape (orders + late, orders + late), in SI."""
        return np.asarray(np.real(np.conj(self.rates) * self.power @ self.rates.T))

    def correlation(self, mixed: FloatArray) -> FloatArray:
        """Return how sums of them follow each other, shape (sums, sums, lags), for lags of all samples.

        `mixed` has shape (sums, orders + late): how much of each they hold.
        """
        lines, sums = len(self.power), mixed @ self.rates
        shared = np.conj(sums)[:, None] * sums * self.power
        # frequencies are half a line off the multiples of one
        turned = np.exp(1j * np.pi * np.arange(2 * lines) / (2 * lines))
        return np.asarray(np.real(np.fft.ifft(shared, 2 * lines) * turned) * 2 * lines)

    @property
    def kept(self) -> FloatArray:
        """How the low-pass behind lines weighs correlations, shape (lags,): their sum is the power left."""
        return np.fft.irfft(self.behind)


def noise_in_front(
    kernel: Kernel | DeflectedKernel,
    record: Record,
    choice: FilterChoice,
    channel: str,
    orders: Sequence[int],
) -> NoiseInFront:
    """Return derivatives of a channel's noise, white before the wide low-pass, as lines are made of them.

    Parameters
    ----------
    kernel : ArmKernel or DeflectedKernel
    record : Record
    choice : FilterChoice
    channel : str
    orders : sequence of int
        How often it is differentiated.
    """
    spectrum, top_hz = record.facts.spectrum(channel), 0.5 * record.fs
    frequency_hz = top_hz * (np.arange(NOISE_LINES) + 0.5) / NOISE_LINES
    wide_hz, order = choice.signal_cutoff_hz or choice.cutoff_hz, choice.filter_order
    power = spectrum.noise * low_pass(frequency_hz, wide_hz, order, record.fs) ** 2 * top_hz / NOISE_LINES
    s = np.asarray(2j * np.pi * frequency_hz, dtype=complex)
    late = beyond_series(kernel, channel, s) if isinstance(kernel, DeflectedKernel) else {}
    rates = np.array([*(s**order for order in orders), *late.values()])
    even_hz = top_hz * np.arange(NOISE_LINES + 1) / NOISE_LINES
    behind = low_pass(even_hz, choice.cutoff_hz, order, record.fs) ** 2
    return NoiseInFront(tuple(late), rates, power, behind)


def beyond_series(kernel: DeflectedKernel, source: str, s: ComplexArray) -> Mapping[Read, ComplexArray]:
    """Return what is to be added to given positions, and their derivatives, per unit of a channel's noise.

    A geometric series after m terms lacks (-lag s)^m / (1 + lag s) of its sum. Lines that positions are made
    of, entries of links, are left out: these positions enter rows linearly.

    Parameters
    ----------
    kernel : DeflectedKernel
    source : str
        The channel.
    s : array, shape (n,)
        2 pi i times frequencies in Hz.

    Returns
    -------
    mapping of (str, int) to array, shape (n,)
        By channel and order of the given positions that see the noise late, in their units over that of the
        channel.
    """
    found: dict[Read, ComplexArray] = {}
    for row in kernel.giving:
        (stiff, lag), (kept, highest) = kernel.spring(row), kernel.orders_of(row)
        response = _without_lag(kernel, row, source, s) / stiff
        if not lag or not response.any():
            continue
        for order in range(kept + 1):
            lacking = (-lag * s) ** (highest - order + 1) / (1.0 + lag * s)
            found[row.channel, order] = response * s**order * lacking
    return found


def _without_lag(kernel: DeflectedKernel, row: GivingRow, source: str, s: ComplexArray) -> ComplexArray:
    """Return how a channel counts in what a row gives, times its stiffness, without what delays it."""
    sums = [(1.0, row.left), *((-float(kernel.point[c]), terms) for c, terms in row.columns.items())]
    found = np.zeros(len(s), dtype=complex)
    for factor, terms in sums:
        for weight, key in without_sought(terms, row.channel).rest:
            channel, order = kernel.read_of(key) if key != "1" else ("", 0)
            if channel == source:
                found += factor * weight * s**order
    return found
