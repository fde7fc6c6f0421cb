"""Plots of a report that the script of the page draws."""

from __future__ import annotations

import numpy as np

from modelgen.report.plots import zoomable
from modelgen.runtime.curves.rebuilt import Rebuilt


def test_a_plot_without_a_sample_says_why() -> None:
    wave, nothing = np.sin(np.arange(50.0)), np.full(50, np.nan)
    drawn = Rebuilt("swing", "m", "N m", 0.0, 0.01, wave, wave, 0, False)
    empty = Rebuilt("swing", "l", "N m", 0.0, 0.01, nothing, nothing, 50, False)
    first, second = (plot["title"] for plot in zoomable([drawn, empty], ()))
    assert first == "swing, row m (no force: measured is zero)"
    assert "not drawn: every sample feels a reversal" in second
