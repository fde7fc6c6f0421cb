"""Pictures in files, one of measured and rebuilt forces; needs matplotlib (the extra `plot`).

PNG, SVG or PDF by the suffix; the same panels give the same bytes: no date, no random names inside.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.atomic_write import write_whole
from modelgen.optional_library import optional_library
from modelgen.runtime.curves.rebuilt import Rebuilt, rebuild
from modelgen.runtime.curves.subject import model_of
from modelgen.runtime.plots.row_plots import draw_row

if TYPE_CHECKING:
    from modelgen.cli.sensor_sets.identified import Identified

# matplotlib would write the date and its version
UNDATED: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def write_figure(path: Path, found: Identified, overwrite: bool) -> None:
    """Write measured and rebuilt rows that hold a force as PNG, SVG or PDF, one panel a record and row.

    Of several sensor sets each is rebuilt with what it says alone. The place and its suffix have been
    checked, see `modelgen.cli.output_files.OutputFiles.check`.

    Raises
    ------
    DataError
        Without matplotlib.
    """
    rows = [
        replace(row, record=f"{title}: {row.record}") if title else row
        for title, model, records, estimate in found.alone()
        for row in rebuild(model_of(estimate, model), records, estimate)[0]
        if row.has_force
    ]
    optional_library("matplotlib", "plot", str(path))
    write_picture(forces_figure(rows), path, overwrite)


def forces_figure(forces: Sequence[Rebuilt]) -> Any:
    """Return measured force, rebuilt force and their difference in panels, two abreast."""
    from matplotlib.figure import Figure

    columns = min(len(forces), 2)
    rows = -(-len(forces) // columns)
    figure = Figure(figsize=(6.0 * columns, 3.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis, row in zip(axes.flat, forces, strict=False):
        draw_row(axis, row)
    for axis in list(axes.flat)[len(forces) :]:
        axis.set_visible(False)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3, frameon=False)
    return figure


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
