"""Checks -> titled tables of plain text, for the summary and the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from modelgen.runtime.diagnostics.filter_scan import FilterScan
from modelgen.runtime.diagnostics.hold_out import HeldOut
from modelgen.runtime.diagnostics.residual_tests import Correlation, ResidualTest
from modelgen.runtime.filter_choice.signal_to_noise import SignalToNoise
from modelgen.runtime.parameters.bounds import BoundCost, bound_sentence
from modelgen.runtime.results.checks import Checks, Periods


@dataclass(frozen=True)
class CheckTable:
    """A title, rows of cells (the first row is the header, `left` columns are texts), and sentences below."""

    title: str
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    sentences: tuple[str, ...] = ()


def check_tables(checks: Checks) -> tuple[CheckTable, ...]:
    """Return a table for every check that was made, in the order of the summary."""
    made = (
        _signals(checks.signals),
        _residuals(checks.residuals),
        _periods(checks.periods) if checks.periods else None,
        _held_out(checks.held_out) if checks.held_out else None,
        _bounds(checks.bounds) if checks.bounds else None,
        _scan(checks.scan) if checks.scan else None,
    )
    return tuple(table for table in made if table is not None)


def _signals(entries: Sequence[SignalToNoise]) -> CheckTable | None:
    """Of every channel on every record the highest derivative in use: where noise is largest."""
    highest: dict[tuple[str, str], SignalToNoise] = {}
    for entry in entries:
        key = entry.record, entry.channel
        if key not in highest or entry.derivative > highest[key].derivative:
            highest[key] = entry
    if not highest:
        return None
    rows = [("record", "channel", "derivative", "unit", "rms", "noise rms", "signal / noise", "seen up to")]
    for entry in highest.values():
        rows.append(
            (
                entry.record,
                entry.channel,
                str(entry.derivative),
                entry.unit,
                f"{entry.rms:.3g}",
                f"{entry.noise_rms:.2g}",
                "-" if entry.snr_db is None else f"{entry.snr_db:.0f} dB",
                "-" if entry.visible_to_hz is None else f"{entry.visible_to_hz:.4g} Hz",
            )
        )
    return CheckTable(
        "Highest derivatives behind the filter, and the noise of their channels", tuple(rows), 4
    )


def _residuals(tests: Sequence[ResidualTest]) -> CheckTable | None:
    if not tests:
        return None
    rows = [("record", "row", "whiteness", "bound", "largest correlation", "bound", "repeats", "verdict")]
    for test in tests:
        one = test.correlation
        tested = test.whiteness is not None
        rows.append(
            (
                test.record,
                test.row,
                "-" if test.whiteness is None else f"{test.whiteness:.1f}",
                "-" if test.whiteness_bound is None else f"{test.whiteness_bound:.1f}",
                "-" if one is None else _correlation(one),
                "-" if one is None else f"{one.bound:.3f}",
                "-" if test.repeated is None else f"{100.0 * test.repeated:.0f} %",
                ("noise" if test.is_noise else "more than noise") if tested else "not tested",
            )
        )
    sentence = (
        "Whiteness of the residual without the colour that the row gives to noise of the sensors, "
        "correlation with past terms of the row, and the share that repeats in every period; bounds of 99 % "
        "for all rows together."
    )
    untested = any(test.whiteness is None for test in tests)
    why = "Not tested: too few samples in one stretch, or a residual below what sampling leaves undone."
    return CheckTable("Residual tests", tuple(rows), 2, (sentence, why) if untested else (sentence,))


def _correlation(found: Correlation) -> str:
    return f"{found.value:.3f} {found.column} {1e3 * found.lag_s:.3g} ms"


def _periods(found: Periods) -> CheckTable:
    listed = ", ".join(f"{record} {period:g} s" for record, period in found.period_s)
    sentence = (
        f'The column "periods" above is the standard deviation from the spread over {found.count} periods '
        f"({listed}). It needs no model of the noise; what is the same in all periods does not show in it."
    )
    return CheckTable("Spread over periods", (), 1, (sentence,))


def _held_out(found: HeldOut) -> CheckTable:
    rows = [("record", "row", "samples", "error %", "where fitted %")]
    for row in found.rows:
        fitted = "-" if row.fitted_error is None else f"{100.0 * row.fitted_error:.3f}"
        rows.append((row.record, row.row, str(row.samples), f"{100.0 * row.relative_error:.3f}", fitted))
    moves = ", ".join(
        f"{one.name} {100.0 * one.share:+.2g} % ({abs(one.move) / one.std if one.std else math.inf:.1f})"
        for one in found.moves
    )
    sentence = (
        f"Identified from it alone, in % of the estimate (standard deviations of the difference): {moves}."
        if moves
        else "It cannot answer the parameters by itself."
    )
    return CheckTable("Held-out records", tuple(rows), 2, (sentence,))


def _bounds(found: BoundCost) -> CheckTable:
    rows = [("at its bound", "without bounds"), *((name, f"{value:.4g}") for name, value in found.active)]
    return CheckTable("Physical bounds", tuple(rows) if found.active else (), 1, (bound_sentence(found),))


def _scan(found: FilterScan) -> CheckTable:
    rows = [("", "cut-off Hz", "order", "decimation", *found.names, "error %")]
    for point in found.points:
        cells = [
            "-" if math.isnan(value) else f"{_as_precise(value, 1.96 * std)} ±{1.96 * std:.2g}"
            for value, std in zip(point.values, point.stds, strict=True)
        ]
        error = "-" if point.relative_error is None else f"{100.0 * point.relative_error:.3f}"
        factors = "/".join(str(factor) for factor in point.decimation)
        mark = "*" if point.chosen else ""
        rows.append((mark, f"{point.cutoff_hz:.4g}", str(point.order), factors, *cells, error))
    failed = tuple(
        f"{point.cutoff_hz:.4g} Hz, order {point.order}: {point.failed}"
        for point in found.points
        if point.failed
    )
    sentence = "* in use; 95 % intervals (±) are what the residual alone explains."
    return CheckTable("Scan of the filter", tuple(rows), 1, (sentence, *failed))


def _as_precise(value: float, reach: float) -> str:
    """Return a number with the digits that an interval of this reach leaves it, one more for comparison."""
    if not (value and 0.0 < reach < math.inf):
        return f"{value:.5g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(reach)) + 2
    return f"{value:.{min(max(digits, 3), 10)}g}"
