"""Filtering: which zero-phase filters the channels of a record go through, as second-order sections.

Matched filtering sends everything through one Butterworth. The paper's chain low-passes the sensors, then
filters every column with the decimation's Chebyshev; as columns are linear in the signals, that is a cascade
for each sensor and the Chebyshev alone for the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import EIGHTH_ORDER, stencil_for
from modelgen.runtime.filters.two_sided_kernel import Sections
from modelgen.runtime.filters.zero_phase import DECIMATE_CUTOFF, DECIMATE_ORDER, DECIMATE_RIPPLE_DB

SECOND_ORDER = (0.5,)  # the central difference of the paper and of numpy.gradient
NO_FILTER = ((1.0, 0.0, 0.0, 1.0, 0.0, 0.0),)


@dataclass(frozen=True)
class Filtering:
    """Sections for each kind of channel, the central difference, and the decimation.

    Attributes
    ----------
    fs : float
        Sampling frequency in Hz of the records that this is for.
    factor : int
        Every factor-th sample is kept.
    sensors, forces : sections
        What the readings go through.
    features : sections
        What sign() and other nonlinear features go through, after they have been formed.
    directions : sections
        What a sensor goes through before the sign of its velocity is taken.
    stencil : tuple of float
        Central difference, see `modelgen.runtime.filters.fused_operator.fused_operator`.
    """

    fs: float
    factor: int
    sensors: Sections
    forces: Sections
    features: Sections
    directions: Sections
    stencil: tuple[float, ...] = EIGHTH_ORDER

    @cached_property
    def largest_gain(self) -> float:
        """Largest gain of the difference over all frequencies, for a sampling period of 1."""
        omega = np.linspace(0.0, np.pi, 512)
        gains = sum(2.0 * c * np.sin(k * omega) for k, c in enumerate(self.stencil, start=1))
        return float(np.max(np.abs(gains)))


def matched_filtering(choice: FilterChoice, fs: float, factor: int) -> Filtering:
    """Return the filtering of "wls": one Butterworth for everything, differences exact below its cut-off."""
    low_pass = butterworth(choice.filter_order, choice.cutoff_hz, fs)
    directions = butterworth(choice.filter_order, choice.direction_cutoff_hz, fs)
    stencil = stencil_for(choice.cutoff_hz, fs)
    return Filtering(fs, factor, low_pass, low_pass, low_pass, directions, stencil)


def paper_filtering(order: int, cutoff_hz: float, fs: float, factor: int) -> Filtering:
    """Return the paper's filtering: sensors low-passed, forces not, every column decimated, order 2."""
    low_pass, columns = butterworth(order, cutoff_hz, fs), decimation_filter(factor)
    return Filtering(fs, factor, low_pass + columns, columns, columns, low_pass, SECOND_ORDER)


@lru_cache(maxsize=128)
def butterworth(order: int, cutoff_hz: float, fs: float) -> tuple[tuple[float, ...], ...]:
    """Return the sections of a Butterworth low-pass."""
    from scipy.signal import butter

    return _rows(butter(order, cutoff_hz, output="sos", fs=fs))


@lru_cache(maxsize=128)
def decimation_filter(factor: int) -> tuple[tuple[float, ...], ...]:
    """Return the sections of the Chebyshev I low-pass of MATLAB's and SciPy's decimate."""
    if factor == 1:
        return NO_FILTER
    from scipy.signal import cheby1

    return _rows(cheby1(DECIMATE_ORDER, DECIMATE_RIPPLE_DB, DECIMATE_CUTOFF / factor, output="sos"))


def _rows(sos: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in sos.tolist())
