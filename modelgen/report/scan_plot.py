"""The scan over cut-offs as plots: one a parameter, its value and the interval that the residual explains."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from modelgen.report.svg import Axis, Line, axis_for, line_plot
from modelgen.runtime.diagnostics.filter_scan import FilterScan

HEIGHT = 170


def scan_plots(scan: FilterScan | None) -> list[Markup]:
    """Return a plot a parameter over the cut-offs in Hz at the order in use; none for fewer than two."""
    if scan is None:
        return []
    order = next(point.order for point in scan.points if point.chosen)
    points = [point for point in scan.points if point.order == order and point.failed is None]
    if len(points) < 2:
        return []
    cutoff_hz = np.array([point.cutoff_hz for point in points])
    chosen_hz = next(point.cutoff_hz for point in points if point.chosen)
    plots = []
    for place, name in enumerate(scan.names):
        value = np.array([point.values[place] for point in points])
        reach = 1.96 * np.array([point.stds[place] for point in points])
        # an upright line an interval, with a gap after each
        bars = np.column_stack([value - reach, value + reach, np.full(len(value), np.nan)]).ravel()
        lines = [
            Line("95 %", "residual", np.repeat(cutoff_hz, 3), bars),
            Line(name, "measured", cutoff_hz, value),
        ]
        x_axis = Axis("cut-off in Hz", 0.95 * cutoff_hz[0], 1.05 * cutoff_hz[-1], True)
        y_axis = axis_for(name, [bars])
        title = f"{name} over the cut-off"
        plots.append(line_plot(x_axis, y_axis, lines, [(chosen_hz, "in use")], title=title, height=HEIGHT))
    return plots
