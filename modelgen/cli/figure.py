"""Pictures in files, one of measured and rebuilt forces; needs matplotlib (the extra `plot`).

PNG, SVG or PDF by the suffix; the same panels give the same bytes: no date, no random names inside.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modelgen.array_types import FloatArray
from modelgen.atomic_write import write_whole
from modelgen.runtime.plots.row_plots import draw_pair, label_row

# matplotlib would write the date and its version
UNDATED: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


@dataclass(frozen=True, eq=False)
class Panel:
    """Measured and rebuilt force, shape (n,) each, at `time_s`; `unit` is that of the force."""

    title: str
    unit: str
    time_s: FloatArray
    measured: FloatArray
    rebuilt: FloatArray


def draw_forces(panels: Sequence[Panel], path: Path, columns: int = 2, overwrite: bool = True) -> None:
    """Draw measured force, rebuilt force and their difference in a grid of panels, and write a picture.

    Raises
    ------
    ImportError
        Without matplotlib.
    """
    from matplotlib.figure import Figure

    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(6.0 * columns, 3.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis, panel in zip(axes.flat, panels, strict=False):
        draw_pair(axis, panel.time_s, panel.measured, panel.rebuilt)
        label_row(axis, panel.title, panel.unit)
    for axis in list(axes.flat)[len(panels) :]:
        axis.set_visible(False)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3, frameon=False)
    write_picture(figure, path, overwrite)


def write_picture(figure: Any, path: Path, overwrite: bool) -> None:
    """Write a figure of matplotlib as PNG, SVG or PDF: the same figure gives the same bytes."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    undated = UNDATED.get(path.suffix.lower(), {})
    # names of clipping paths in an SVG are random unless they are salted
    with rc_context({"svg.hashsalt": "modelgen", "svg.fonttype": "path"}):
        drawn = io.BytesIO()
        kind = path.suffix.lower().removeprefix(".")
        FigureCanvasAgg(figure).print_figure(drawn, dpi=120, format=kind, metadata=undated)
    write_whole(path, drawn.getvalue(), overwrite=overwrite)
