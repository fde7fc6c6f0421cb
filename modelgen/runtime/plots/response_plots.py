"""Frequency responses: magnitude, phase and coherence over the frequency in Hz."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.runtime.curves.response_phase import wrapped_phase
from modelgen.runtime.curves.thresholds import Z_95
from modelgen.runtime.plots.axes import VERBATIM, colours, drawn, panels
from modelgen.runtime.records.thresholds import LEAST_COHERENCE

if TYPE_CHECKING:
    from modelgen.runtime.curves.model_response import ModelResponse
    from modelgen.runtime.records.frequency_response import FrequencyResponse

HEIGHTS = (1.3, 1.0, 0.7)


class ResponsePlot:
    """Draws a measured frequency response; returns its axes."""

    def __init__(self, response: FrequencyResponse) -> None:
        self._response = response

    def __call__(self, axes: Any = None, unit: str = "SI units") -> Any:
        """Draw magnitude, phase in degrees and coherence, with 95 % of what noise makes shaded.

        Parameters
        ----------
        axes : sequence of three Axes, optional
            By default those of a new figure.
        unit : str
            Of the response.

        Returns
        -------
        array of Axes

        Raises
        ------
        DataError
            When there are other than three axes, or matplotlib is not installed.
        """
        found = self._response
        axes = panels(axes, 3, HEIGHTS)
        draw_measured(axes, found)
        label_axes(axes, f"{found.output} over {found.input}, {found.record}", unit)
        return drawn(axes)


def draw_measured(axes: list[Any], found: FrequencyResponse) -> None:
    """Draw a measured response into three axes: pale where it is mere chance, and there without a phase."""
    colour, f = colours(axes[0]).measured, found.frequency_hz
    size, reach = np.abs(found.response), Z_95 * found.std
    mark = "o" if f.size < 60 else None
    style = {"color": colour, "linewidth": 1.6, "marker": mark, "markersize": 3.0}
    told = found.coherence >= LEAST_COHERENCE
    axes[0].loglog(f, size, color=colour, linewidth=0.6, alpha=0.4)
    axes[0].loglog(f, np.where(told, size, np.nan), label="measured", **style)
    low = np.maximum(size - reach, size / 100.0)
    axes[0].fill_between(f, low, size + reach, where=told, color=colour, alpha=0.25, linewidth=0.0)
    phase = wrapped_phase(found.response, told)
    axes[1].semilogx(f, phase, **style)
    axes[2].semilogx(f, found.coherence, **{**style, "color": colours(axes[2]).residual, "linewidth": 1.0})


def draw_modelled(axes: list[Any], found: ModelResponse) -> None:
    """Draw a modelled response with its 95 % band into magnitude and phase."""
    colour, f = colours(axes[0]).modelled, found.frequency_hz
    style = {"color": colour, "linewidth": 1.2}
    if not np.isfinite(found.response).any():
        return
    axes[0].loglog(f, np.abs(found.response), label=found.label, **style)
    axes[0].fill_between(f, *found.magnitude_band(), color=colour, alpha=0.2, linewidth=0.0, label="95 %")
    phase, reach = wrapped_phase(found.response), found.phase_reach_deg()
    axes[1].semilogx(f, phase, **style)
    axes[1].fill_between(f, phase - reach, phase + reach, color=colour, alpha=0.2, linewidth=0.0)


def label_axes(axes: list[Any], title: str, unit: str) -> None:
    """Write what is shown, with units, along three axes of a frequency response."""
    axes[0].set_title(title, loc="left", **VERBATIM)
    axes[0].set_ylabel(f"magnitude in {unit}")
    axes[1].set_ylabel("phase in deg")
    axes[1].set_ylim(-280.0, 100.0)
    axes[1].set_yticks([-270, -180, -90, 0, 90])
    axes[2].set_ylabel("coherence")
    axes[2].set_ylim(0.0, 1.05)
    axes[2].set_xlabel("frequency in Hz")
    for axis in axes:
        axis.margins(x=0.0)
        axis.grid(alpha=0.25)
