"""Figures 3 and 4 of the paper: tracking error of the load and motor torque, simulated and measured.

"Measured" is the simulated bench with noise; "simulated" is the identified model in the same loop under the
same reference. The load's encoder is drawn in both, though Table 2 was identified without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.cli.demo.bench import FS_HZ, bench
from modelgen.cli.demo.printed_tables import PrintedTable
from modelgen.cli.figure import write_picture
from modelgen.runtime.model.model import Model
from modelgen.runtime.plots.row_plots import draw_pair
from modelgen.runtime.simulation.simulate import simulate

WINDOWS_S = {"chirp": (4.0, 4.2), "trapezoid": (0.0, 1.0)}  # about the flexible mode; one period
QUANTITIES = {"q_c": "(a) tracking error of the load in rad", "Gamma_m": "(b) motor torque (current) in N m"}


def draw_closed_loop(
    printed: PrintedTable,
    model: Model,
    true: Mapping[str, float],
    identified: Mapping[str, float],
    path: Path,
) -> Path | None:
    """Draw the figure and return its path, or None where matplotlib is missing.

    Parameters
    ----------
    printed : PrintedTable
        Of the bench; its number gives the figure's.
    model : Model
        With both encoders.
    true, identified : mapping of str to float
        Parameters (SI) of the bench, and of the model that is compared with it.
    path : Path
        A PNG.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return None
    figure = Figure(figsize=(12.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2)
    for column, (name, time_s, shown) in enumerate(_windows(model, true, identified)):
        for axis, (key, (measured, simulated)) in zip(axes[:, column], shown.items(), strict=True):
            draw_pair(axis, time_s, measured, simulated, ("measured", "simulated"))
            axis.set_ylabel(QUANTITIES[key])
            axis.margins(x=0.0)
        axes[0, column].set_title(name, loc="left", fontsize=10)
        axes[1, column].set_xlabel("time in s")
    figure.align_ylabels(axes)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=3, frameon=False)
    title = (
        f"Figure {printed.number + 2}: the bench of Table {printed.number} and the model identified from it"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    write_picture(figure, path, overwrite=True)
    return path


def _windows(
    model: Model, true: Mapping[str, float], identified: Mapping[str, float]
) -> list[tuple[str, FloatArray, dict[str, tuple[FloatArray, FloatArray]]]]:
    """Return of each experiment its name, times in s, and what is measured and simulated of each quantity."""
    found = []
    for experiment in bench(model, true):
        excitation, measured = experiment.excitation, experiment.record
        loop = experiment.controller
        simulated = simulate(model, identified, excitation, fs=FS_HZ, controller=loop).true
        start, stop = (round(edge * FS_HZ) for edge in WINDOWS_S[excitation.name])
        reference = excitation.reference[:: round(excitation.rate_hz / FS_HZ)]
        pairs = {
            "q_c": (reference - measured.signals["q_c"], reference - simulated["q_c"]),
            "Gamma_m": (measured.signals["Gamma_m"], simulated["Gamma_m"]),
        }
        shown = {key: (a[start:stop], b[start:stop]) for key, (a, b) in pairs.items()}
        found.append((excitation.name, np.arange(start, stop) / FS_HZ, shown))
    return found
