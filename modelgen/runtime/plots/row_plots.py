"""Rows of the model over time: measured, rebuilt, and what is left; and its autocorrelation."""

from __future__ import annotations

from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.curves.buckets import buckets
from modelgen.runtime.curves.rebuilt import Autocorrelation, Rebuilt
from modelgen.runtime.plots.axes import VERBATIM, colours

QUANTITIES = {"N m": "torque", "N": "force"}  # a row that is differentiated has another unit
MOST = 4000  # intervals of a curve: more than a screen has pixels


def draw_row(axis: Any, row: Rebuilt) -> None:
    """Draw the measured and rebuilt left-hand side of a row and their difference over time in s."""
    draw_pair(axis, _times(row), row.measured, row.rebuilt)
    _say_if_empty(axis, row)
    label_row(axis, f"{row.record}, row {row.row}", row.unit)


def draw_pair(
    axis: Any,
    time_s: FloatArray,
    measured: FloatArray,
    modelled: FloatArray,
    names: tuple[str, str] = ("measured, filtered", "rebuilt"),
) -> None:
    """Draw what is measured, what the model says, and their difference, in one unit, shape (n,) each."""
    colour = colours(axis)
    draw_series(axis, time_s, measured, color=colour.measured, linewidth=3.0, label=names[0])
    draw_series(axis, time_s, modelled, color=colour.modelled, linewidth=1.0, label=names[1])
    draw_series(axis, time_s, measured - modelled, color=colour.residual, linewidth=0.8, label="difference")


def draw_residual(axis: Any, row: Rebuilt) -> None:
    """Draw the residual of a row over time in s."""
    draw_series(axis, _times(row), row.residual, color=colours(axis).residual, linewidth=0.8)
    _say_if_empty(axis, row)
    label_row(axis, f"{row.record}, row {row.row}", row.unit)


def draw_autocorrelation(axis: Any, found: Autocorrelation | None) -> None:
    """Draw the autocorrelation of a residual over the lag in ms, with the 99 % bound of a white one."""
    axis.set_title("autocorrelation", loc="left", fontsize=10)
    axis.set_xlabel("lag in ms")
    if found is None:
        _write_across(axis, "a residual of fewer than 20 samples, or of zeros")
        return
    colour, lag_ms = colours(axis), 1e3 * found.step_s * np.arange(found.values.size, dtype=float)
    axis.axhspan(-found.bound, found.bound, color=colour.modelled, alpha=0.2, linewidth=0.0)
    axis.vlines(lag_ms, 0.0, found.values, color=colour.residual, linewidth=0.8)
    axis.axhline(0.0, color=colour.measured, linewidth=0.8)
    axis.margins(x=0.01)


def _say_if_empty(axis: Any, row: Rebuilt) -> None:
    if not np.isfinite(row.residual).any():
        _write_across(axis, "not drawn: no sample of it is left, as near reversals")


def _write_across(axis: Any, text: str) -> None:
    axis.text(0.5, 0.5, text, ha="center", va="center", fontsize=8, transform=axis.transAxes)


def label_row(axis: Any, title: str, unit: str) -> None:
    """Write what is shown, with units, along an axis."""
    axis.set_title(title, loc="left", fontsize=10, **VERBATIM)
    axis.set_xlabel("time in s")
    axis.set_ylabel(f"{QUANTITIES.get(unit, 'row')} in {unit}")
    axis.margins(x=0.0)


def draw_series(axis: Any, time_s: FloatArray, values: FloatArray, **style: Any) -> None:
    """Draw a series over time, a long one as its lowest and highest values; NaN leaves a gap.

    Times in s and values, in the unit of the axis, have shape (n,).
    """
    step = -(-values.size // MOST)
    if step <= 1:
        axis.plot(time_s, values, **style)
        return
    low, high = buckets(values, step)
    # up and down within each interval: every peak stays
    axis.plot(np.repeat(time_s[::step], 2), np.column_stack((low, high)).ravel(), **style)


def _times(row: Rebuilt) -> FloatArray:
    return row.start_s + row.step_s * np.arange(row.measured.size, dtype=float)
