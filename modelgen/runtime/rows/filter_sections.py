"""Filtering: the zero-phase filters that the channels of a record go through, as second-order sections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.turning_band import FasterTurns
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.derivatives import EIGHTH_ORDER, stencil_for
from modelgen.runtime.filters.two_sided_kernel import Sections


@dataclass(frozen=True)
class Filtering:
    """Sections of the low-passes, the central difference, and the decimation.

    Attributes
    ----------
    fs : float
        Sampling frequency in Hz of the records that this is for.
    factor : int
        Every factor-th sample is kept.
    low_pass : sections
        What every reading goes through, and sign() and other nonlinear features after they have been formed.
    signals : sections
        The wide low-pass in front of what is nonlinear in several signals; empty where nothing is.
    directions : sections
        What a sensor goes through before the sign of its velocity is taken.
    stencil : tuple of float
        Central difference, see `modelgen.runtime.filters.fused_operator.fused_operator`.
    between : bool
        Whether directions are means over sampling periods, of motion that reverses between two samples.
    faster : tuple of FasterTurns
        Channels of which faster motion turns directions as well.
    """

    fs: float
    factor: int
    low_pass: Sections
    directions: Sections
    stencil: tuple[float, ...] = EIGHTH_ORDER
    signals: Sections = ()
    between: bool = False
    faster: tuple[FasterTurns, ...] = ()

    @property
    def linear(self) -> Sections:
        """What goes through filters that commute with it: both low-passes, where there are two."""
        return self.low_pass + self.signals

    @cached_property
    def largest_gain(self) -> float:
        """Largest gain of the difference over all frequencies, for a sampling period of 1."""
        omega = np.linspace(0.0, np.pi, 512)
        gains = sum(2.0 * c * np.sin(k * omega) for k, c in enumerate(self.stencil, start=1))
        return float(np.max(np.abs(gains)))


def matched_filtering(choice: FilterChoice, fs: float, factor: int) -> Filtering:
    """Return the filtering of "wls": one Butterworth for everything, differences exact below its cut-off."""
    cutoffs = (choice.cutoff_hz, choice.direction_cutoff_hz, choice.signal_cutoff_hz)
    filtering = _matched_filtering(choice.filter_order, cutoffs, choice.between, fs, factor)
    faster = tuple(one for one in choice.faster if one.band_hz > choice.direction_cutoff_hz)
    return replace(filtering, faster=faster) if faster else filtering


@lru_cache(maxsize=128)  # rows are made of one change of the channels after the other
def _matched_filtering(
    order: int, cutoffs_hz: tuple[float, float, float | None], between: bool, fs: float, factor: int
) -> Filtering:
    """Return the filtering of cut-offs of rows, of directions, and of signals where these have their own."""
    of_rows, of_directions, of_signals = cutoffs_hz
    low_pass, directions = butterworth(order, of_rows, fs), butterworth(order, of_directions, fs)
    if of_signals is None:
        return Filtering(fs, factor, low_pass, directions, stencil_for(of_rows, fs), between=between)
    signals = butterworth(order, of_signals, fs)
    return Filtering(fs, factor, low_pass, directions, stencil_for(of_signals, fs), signals, between)
