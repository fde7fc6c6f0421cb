"""The plots of a report: small ones as SVG, and those that the script of the page draws at any zoom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from modelgen.array_types import FloatArray
from modelgen.report.envelope import encoded_series
from modelgen.report.svg import Axis, Line, axis_for, bar_plot, heat_map, line_plot, stem_plot
from modelgen.runtime.curves.rebuilt import Autocorrelation, Rebuilt
from modelgen.runtime.curves.response_phase import wrapped_phase
from modelgen.runtime.curves.responses import ResponsePair
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.records.thresholds import LEAST_COHERENCE
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.validation import Validation

# 16-bit values the page may carry in all: 3.2 MB of base64
BUDGET = 1_200_000
MOST_BUCKETS = 60_000


def zoomable(rows: Sequence[Rebuilt], validations: Sequence[Validation]) -> list[dict[str, Any]]:
    """Return the plots that the script draws: rows with measured, rebuilt and residual, and closed loops."""
    checks = [(validation, check) for validation in validations for check in validation.checks]
    series = 3 * (len(rows) + len(checks))
    most = min(MOST_BUCKETS, BUDGET // max(2 * series, 1))
    plots = [
        {
            "title": _titled(row),
            "unit": row.unit,
            "start": row.start_s,
            "step": row.step_s,
            "count": int(row.measured.size),
            "series": [
                encoded_series("measured, filtered", "measured", row.measured, most),
                encoded_series("rebuilt", "rebuilt", row.rebuilt, most),
                encoded_series("residual", "residual", row.residual, most),
            ],
        }
        for row in rows
    ]
    plots += [
        {
            "title": f"{validation.record}, {validation.kind}: {check.channel}, {check.kind}, "
            f"fit {check.fit:.2f}%",
            "unit": check.unit,
            "start": check.start / validation.fs,
            "step": 1.0 / validation.fs,
            "count": int(check.measured.size),
            "series": [
                encoded_series("measured", "measured", check.measured, most),
                encoded_series("simulated", "rebuilt", check.simulated, most),
                encoded_series("difference", "residual", check.measured - check.simulated, most),
            ],
        }
        for validation, check in checks
    ]
    return plots


def _titled(row: Rebuilt) -> str:
    """Return the title of a row's plot, and why there is nothing in it."""
    title = f"{row.record}, row {row.row}"
    if not np.isfinite(row.measured).any():
        return f"{title} (not drawn: every sample feels a reversal, and friction is that of a simulation)"
    return title if row.has_force else f"{title} (no force: measured is zero)"


def autocorrelation_plot(row: Rebuilt, found: Autocorrelation) -> Markup:
    """Return the residual's autocorrelation with the 99 % bound of a white one."""
    lags_ms = 1e3 * found.step_s * np.arange(found.values.size, dtype=float)
    x_axis = Axis("lag in ms", 0.0, float(lags_ms[-1]) or 1.0)
    lowest = min(-0.2, 1.1 * float(found.values.min()), -1.5 * found.bound)
    y_axis = Axis("autocorrelation", lowest, 1.05)
    title = f"autocorrelation of the residual: {row.record}, row {row.row}"
    return stem_plot(x_axis, y_axis, lags_ms, found.values, found.bound, title)


def response_plots(pair: ResponsePair, estimate: Estimate) -> tuple[Markup, Markup, Markup]:
    """Return magnitude, phase and coherence with the model's 95 % band, the cut-offs marked."""
    found, modelled = pair.measured, pair.modelled
    f, curve = found.frequency_hz, modelled.frequency_hz
    x_axis = Axis("frequency in Hz", float(f[0]), float(f[-1]), True)
    marks = _marks(estimate)
    unnamed = [(value, "") for value, _ in marks]
    gains = [
        _area(curve, *modelled.magnitude_band()),
        Line("measured", "measured", f, np.abs(found.response)),
        Line("modelled", "rebuilt", curve, np.abs(modelled.response)),
    ]
    phase, reach = wrapped_phase(modelled.response), modelled.phase_reach_deg()
    phases = [
        _area(curve, phase - reach, phase + reach),
        Line("measured", "measured", f, wrapped_phase(found.response, found.coherence >= LEAST_COHERENCE)),
        Line("modelled", "rebuilt", curve, phase),
    ]
    title = f"{found.output} over {found.input}, {found.record}"
    gain_axis = axis_for(modelled.unit, [line.y for line in gains[1:]], logarithmic=True)
    magnitude = line_plot(x_axis, gain_axis, gains, marks, title=f"magnitude of {title}")
    turned = line_plot(
        x_axis, Axis("phase in deg", -280.0, 100.0), phases, unnamed, title=f"phase of {title}", height=180
    )
    coherence = line_plot(
        x_axis,
        Axis("coherence", 0.0, 1.05),
        [Line("coherence", "residual", f, found.coherence)],
        unnamed,
        title=f"coherence of {title}",
        height=150,
    )
    return magnitude, turned, coherence


def _area(x: FloatArray, low: FloatArray, high: FloatArray) -> Line:
    """Return the line around a band, shape (points,) each, gaps left out."""
    told = np.isfinite(low) & np.isfinite(high)
    x, low, high = x[told], low[told], high[told]
    return Line("95 %", "area", np.r_[x, x[::-1]], np.r_[high, low[::-1]])


def _marks(estimate: Estimate) -> list[tuple[float, str]]:
    """Return the frequencies to mark in Hz, each once, with all its words."""
    filtering = estimate.fit.filtering
    named = [(filtering.cutoff_hz, "cut-off"), (filtering.direction_cutoff_hz, "directions")]
    if filtering.dynamics_hz is not None:
        named.append((filtering.dynamics_hz, "dynamics"))
    words: dict[float, list[str]] = {}
    for value, word in named:
        words.setdefault(value, []).append(word)
    return [(value, ", ".join(found)) for value, found in words.items()]


def correlation_plot(estimate: Estimate) -> Markup | None:
    """Return the correlation of the parameters as a map of colours; None for fewer than two."""
    if len(estimate.parameters.identified) < 2:
        return None
    spread = np.sqrt(np.diag(estimate.covariances.total))
    spread = np.where(spread > 0.0, spread, 1.0)
    names = [entry.name for entry in estimate.parameters.identified]
    return heat_map(
        names, estimate.covariances.total / np.outer(spread, spread), "correlation of the parameters"
    )


def singular_value_plot(values: FloatArray) -> Markup | None:
    """Return the plot of the singular values of the weighted W (columns of unit length), shape (columns,)."""
    kept = values[values > 0.0]
    if not kept.size:
        return None
    names = [str(index + 1) for index in range(kept.size)]
    axis = Axis("singular value", float(kept.min()) / 2.0, float(kept.max()) * 1.3, True)
    return bar_plot(axis, kept, names, "singular values of W with columns of unit length")


def whiteness(found: Autocorrelation) -> float:
    """Return which share of the lags lies outside the 99 % bound, in %."""
    outside = np.abs(found.values[1:]) > found.bound
    return 100.0 * float(np.mean(outside)) if outside.size else 0.0


def filter_reach_ms(estimate: Estimate, fs: float) -> float:
    """Return the reach of the low-pass in ms: it correlates residuals closer to each other than that."""
    filtering = estimate.fit.filtering
    return 1e3 * support_samples(filtering.filter_order, filtering.cutoff_hz, fs, 0, 0.01) / fs
