"""A trend: every quantity over its entries, with 95 % intervals and the means between changes."""

from __future__ import annotations

from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.optional_library import optional_library
from modelgen.runtime.plots.axes import VERBATIM, colours
from modelgen.runtime.trend.thresholds import Z95
from modelgen.runtime.trend.trend import QuantityTrend, Trend

COLUMNS, WIDTH, HEIGHT = 2, 5.5, 2.4  # of the grid; of a panel in inches
MOST_TICKS = 6


def draw_trend(found: Trend) -> Any:
    """Return a figure of matplotlib: a panel a quantity; entries at their dates where all have one.

    Raises
    ------
    DataError
        When matplotlib is not installed.
    """
    figures = optional_library("matplotlib.figure", "plot", "plot")
    count = len(found.quantities)
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    figure = figures.Figure(figsize=(WIDTH * columns, HEIGHT * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    places = _places(found.labels)
    for axis, one in zip(axes.flat, found.quantities, strict=False):
        _draw_quantity(axis, one, places)
        _label(axis, one, found, places)
    for axis in list(axes.flat)[count:]:
        axis.set_visible(False)
    return figure


def _places(labels: tuple[str, ...]) -> FloatArray:
    """Return where the entries are drawn: days where all labels are different dates, else their numbers."""
    try:
        days = [date.fromisoformat(label).toordinal() for label in labels]
    except ValueError:
        days = []
    apart = len(set(days)) == len(labels)
    return np.array(days if apart else range(len(labels)), dtype=float)


def _draw_quantity(axis: Any, one: QuantityTrend, places: FloatArray) -> None:
    colour, series = colours(axis), one.series
    x = places[series.entries]
    reach = Z95 * np.hypot(series.noise, series.drift)
    axis.errorbar(x, series.values, reach, fmt="o", color=colour.measured, markersize=4.0, capsize=2.0)
    bounds = [0, *(np.flatnonzero(np.diff(one.levels)) + 1).tolist(), len(x)]
    for first, end in pairwise(bounds):
        of = one.levels == one.levels[first]
        mean = float(np.average(series.values[of], weights=1.0 / reach[of] ** 2))
        ends = [0.5 * (x[max(k - 1, 0)] + x[min(k, len(x) - 1)]) for k in (first, end)]
        axis.plot(ends, [mean, mean], color=colour.modelled, linewidth=1.6)
    for bound in bounds[1:-1]:
        between = 0.5 * (x[bound - 1] + x[bound])
        axis.axvline(between, color=colour.residual, linewidth=1.0, linestyle="--")


def _label(axis: Any, one: QuantityTrend, found: Trend, places: FloatArray) -> None:
    series = one.series
    said = "scatters" if one.scatters else "no change"
    if one.changes:
        said = f"changed {found.labels[one.changes[0].entry]}"
    axis.set_title(f"{series.name}, {said}", loc="left", fontsize=10, **VERBATIM)
    axis.set_ylabel(series.unit or "1")
    axis.ticklabel_format(axis="y", useOffset=False)
    shown = np.unique(np.linspace(0, len(places) - 1, min(MOST_TICKS, len(places))).round().astype(int))
    labels = [label if len(label) <= 16 else f"{label[:13]}..." for label in found.labels]
    shown_labels = [labels[k] for k in shown]
    axis.set_xticks(places[shown], shown_labels, rotation=20, fontsize=8, ha="right", **VERBATIM)
    margin = 0.05 * max(float(places[-1] - places[0]), 1.0)
    axis.set_xlim(places[0] - margin, places[-1] + margin)
