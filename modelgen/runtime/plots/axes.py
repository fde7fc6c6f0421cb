"""Axes that are given, or those of a new figure; colours that suit their ground.

Nothing is shown, and no setting of matplotlib is changed. In a notebook, and where pyplot is in use already,
a new figure is one of pyplot's, so that it appears there; else it belongs to nobody but the caller.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.errors import DataError
from modelgen.optional_library import optional_library

#: for names of records and channels, which may be any text: a $ in them begins no formula
VERBATIM: dict[str, Any] = {"parse_math": False}
WIDTH, HEIGHT = 7.5, 2.4  # of a panel, in inches


@dataclass(frozen=True)
class Colours:
    """What is measured, what the model says, and what is left between them."""

    measured: str
    modelled: str
    residual: str
    others: tuple[str, ...]


LIGHT = Colours("#8793a0", "#0b5cad", "#c2410c", ("#0b5cad", "#c2410c", "#15803d", "#7e22ce", "#a16207"))
DARK = Colours("#8d99a6", "#58a6ff", "#ff8a4c", ("#58a6ff", "#ff8a4c", "#4ade80", "#c084fc", "#facc15"))


def colours(axis: Any) -> Colours:
    """Return the colours that can be read on the ground of an axis."""
    to_rgb = optional_library("matplotlib.colors", "plot", "plot").to_rgba
    red, green, blue, alpha = to_rgb(axis.get_facecolor())
    if alpha == 0.0:
        red, green, blue, _ = to_rgb(axis.figure.get_facecolor())
    return DARK if 0.299 * red + 0.587 * green + 0.114 * blue < 0.5 else LIGHT


def panels(
    given: Any, count: int, heights: Sequence[float] | None = None, sharex: bool = True, columns: int = 1
) -> list[Any]:
    """Return so many axes, row by row: the given ones, or those of a new figure.

    Parameters
    ----------
    given : Axes, sequence or array of Axes, or None
    count : int
    heights : sequence of float, optional
        Of the rows of a new figure, relative to each other.
    sharex : bool
        Whether the panels of a new figure share their x axis.
    columns : int
        Of a new figure.

    Raises
    ------
    DataError
        When another number of axes is given, or matplotlib is not installed.
    """
    optional_library("matplotlib", "plot", "plot")
    if given is not None:
        axes = [given] if hasattr(given, "plot") and hasattr(given, "figure") else list(np.ravel(given))
        if len(axes) != count:
            raise DataError.at("axes", f"are {len(axes)}", f"give {count}, or none for a new figure")
        return axes
    ratios = list(heights or [1.0] * (count // columns))
    figure = _new_figure((WIDTH * (1.0 + 0.5 * (columns - 1)), HEIGHT * max(sum(ratios), 1.5)))
    grid = figure.subplots(
        len(ratios), columns, sharex=sharex, squeeze=False, gridspec_kw={"height_ratios": ratios}
    )
    return list(grid.flat)


def _new_figure(size: tuple[float, float]) -> Any:
    if "ipykernel" in sys.modules or "matplotlib.pyplot" in sys.modules:
        pyplot = optional_library("matplotlib.pyplot", "plot", "plot")
        return pyplot.figure(figsize=size, layout="constrained")
    figures = optional_library("matplotlib.figure", "plot", "plot")
    backend = optional_library("matplotlib.backends.backend_agg", "plot", "plot")
    figure = figures.Figure(figsize=size, layout="constrained")
    backend.FigureCanvasAgg(figure)
    return figure


def drawn(axes: Sequence[Any]) -> Any:
    """Return the axes as they are handed back: one alone, several as an array as pyplot.subplots does."""
    if len(axes) == 1:
        return axes[0]
    found = np.empty(len(axes), dtype=object)
    found[:] = axes
    return found
