"""The estimate over cut-offs and filter orders: what a choice of the filter does to every parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import counted
from modelgen.runtime.diagnostics.thresholds import HIGHEST_ORDER, LOWEST_ORDER, ORDER_STEPS, SCANNED_FACTORS
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.record_length import decimation_for
from modelgen.runtime.filter_choice.thresholds import HIGHEST_CUTOFF
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record

AUTO = "auto"


@dataclass(frozen=True)
class ScanPoint:
    """One setting of the filter and what comes out; `failed` says why nothing does.

    `values` and `stds` (what the residual explains) are in the order of the scan's `names`, NaN where the
    records do not answer a parameter behind this filter.
    """

    cutoff_hz: float
    order: int
    decimation: tuple[int, ...]
    chosen: bool
    values: tuple[float, ...]
    stds: tuple[float, ...]
    relative_error: float | None
    failed: str | None = None


@dataclass(frozen=True)
class FilterScan:
    """Estimates over settings of the filter, by cut-off and then order; one of them is the chosen one."""

    names: tuple[str, ...]
    points: tuple[ScanPoint, ...]


def scanned_settings(
    choice: FilterChoice, records: Sequence[Record], cutoffs_hz: Sequence[float] | str
) -> tuple[FilterChoice, ...]:
    """Return the settings to try, the chosen one among them; "auto" tries cut-offs and orders around it.

    Raises
    ------
    DataError
        When a cut-off is not between 0 and half the lowest sampling frequency, or a word is not "auto".
    """
    lowest_fs = min(record.fs for record in records)
    if isinstance(cutoffs_hz, str):
        if cutoffs_hz != AUTO:
            raise DataError.at("scan_cutoffs", f"is {cutoffs_hz!r}", f'give frequencies in Hz, or "{AUTO}"')
        highest = HIGHEST_CUTOFF * lowest_fs
        wanted = [
            factor * choice.cutoff_hz for factor in SCANNED_FACTORS if factor * choice.cutoff_hz <= highest
        ]
        orders = [choice.filter_order + step for step in ORDER_STEPS]
        others = [
            replace(choice, filter_order=order) for order in orders if LOWEST_ORDER <= order <= HIGHEST_ORDER
        ]
    else:
        wrong = [hz for hz in cutoffs_hz if not 0.0 < hz < 0.5 * lowest_fs]
        if wrong or not cutoffs_hz:
            remedy = f"give frequencies between 0 and half the sampling frequency, {0.5 * lowest_fs:g} Hz"
            raise DataError.at("scan_cutoffs", f"holds {wrong[0]!r}" if wrong else "is empty", remedy)
        wanted, others = [float(hz) for hz in cutoffs_hz], []
    settings = [choice, *others]
    for hz in wanted:
        if abs(hz / choice.cutoff_hz - 1.0) > 1e-9:
            factors = tuple(decimation_for(record.fs, hz) for record in records)
            settings.append(replace(choice, cutoff_hz=hz, decimation=factors))
    return tuple(sorted(settings, key=lambda one: (one.cutoff_hz, one.filter_order)))


def scan_filters(
    fit: Fit,
    choice: FilterChoice,
    settings: Sequence[FilterChoice],
    again: Callable[[FilterChoice], Fit],
    identified: Sequence[str],
) -> FilterScan:
    """Fit with every setting; `again` observes and fits, `fit` is that of the chosen one."""
    points = []
    for setting in counted(settings, "other filters"):
        chosen = setting == choice
        try:
            found = fit if chosen else again(setting)
        except (DataError, IdentifiabilityError) as error:
            points.append(_point(setting, chosen, None, identified, error.problems[0].what))
            continue
        points.append(_point(setting, chosen, found, identified, None))
    return FilterScan(tuple(identified), tuple(points))


def _point(
    setting: FilterChoice, chosen: bool, fit: Fit | None, names: Sequence[str], failed: str | None
) -> ScanPoint:
    values, stds = [float("nan")] * len(names), [float("nan")] * len(names)
    if fit is not None:
        spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
        for place, name in enumerate(names):
            if name in fit.columns:
                index = fit.columns.index(name)
                values[place], stds[place] = float(fit.solution.x[index]), float(spread[index])
    return ScanPoint(
        setting.cutoff_hz,
        setting.filter_order,
        setting.decimation,
        chosen,
        tuple(values),
        tuple(stds),
        None if fit is None else fit.relative_error,
        failed,
    )
