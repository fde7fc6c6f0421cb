"""Checks: everything that was tried on an estimate and its experiment, in one frozen record."""

from __future__ import annotations

from dataclasses import dataclass

from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.filter_scan import FilterScan
from modelgen.runtime.diagnostics.hold_out import HeldOut
from modelgen.runtime.diagnostics.residual_tests import ResidualTest
from modelgen.runtime.filter_choice.signal_to_noise import SignalToNoise
from modelgen.runtime.parameters.bounds import BoundCost


@dataclass(frozen=True)
class Periods:
    """What the spread over `count` periods gives: `covariance` in the order of the estimate's parameters.

    `period_s` holds pairs of record and period in s.
    """

    count: int
    period_s: tuple[tuple[str, float], ...]
    covariance: tuple[tuple[float, ...], ...]

    @property
    def std(self) -> tuple[float, ...]:
        """Standard deviations in the order of the estimate's parameters."""
        return tuple(row[k] ** 0.5 for k, row in enumerate(self.covariance))


@dataclass(frozen=True)
class Checks:
    """What the guards, the tests of the residual and the optional comparisons found.

    Attributes
    ----------
    advice : tuple of Advice
        What is wrong with the experiment or the estimate, and what to do about it.
    residuals : tuple of ResidualTest
        Of every row on every record that was used.
    signals : tuple of SignalToNoise
        Every derivative in use, compared with its noise.
    periods : Periods or None
        Where every record is periodic.
    held_out : HeldOut or None
    scan : FilterScan or None
    bounds : BoundCost or None
    kept : tuple of str
        Parameters that were to be kept, whatever speaks against them.
    """

    advice: tuple[Advice, ...] = ()
    residuals: tuple[ResidualTest, ...] = ()
    signals: tuple[SignalToNoise, ...] = ()
    periods: Periods | None = None
    held_out: HeldOut | None = None
    scan: FilterScan | None = None
    bounds: BoundCost | None = None
    kept: tuple[str, ...] = ()
