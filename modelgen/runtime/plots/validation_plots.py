"""`validation.plot()`: every signal of a record, measured and modelled, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.runtime.plots.axes import VERBATIM, drawn, panels
from modelgen.runtime.plots.row_plots import draw_pair

if TYPE_CHECKING:
    from modelgen.runtime.simulation.validation import Validation


class ValidationPlot:
    """Draws a validation; returns its axes."""

    def __init__(self, validation: Validation) -> None:
        self._validation = validation

    def __call__(self, axes: Any = None) -> Any:
        """Draw every signal over time in s, measured, modelled and their difference, with its fit in %.

        Parameters
        ----------
        axes : Axes or sequence of Axes, optional
            One a signal; by default those of a new figure.

        Returns
        -------
        Axes, or array of Axes

        Raises
        ------
        DataError
            When another number of axes is given, or matplotlib is not installed.
        """
        found = self._validation
        axes = panels(axes, len(found.checks))
        for axis, check in zip(axes, found.checks, strict=True):
            time_s = (check.start + np.arange(check.measured.size, dtype=float)) / found.fs
            draw_pair(axis, time_s, check.measured, check.simulated, ("measured", found.kind))
            what = f"{found.record}, {check.channel}: {check.kind}, fit {check.fit:.4g} %"
            axis.set_title(what, loc="left", fontsize=10, **VERBATIM)
            axis.set_ylabel(f"{check.channel} in {check.unit}")
            axis.margins(x=0.0)
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, fontsize=8)
        axes[-1].set_xlabel("time in s")
        return drawn(axes)
