"""`modelgen trend`: what has changed over the estimates of a machine, and since when."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.options import ResultOptions
from modelgen.cli.output import deliver
from modelgen.cli.output_files import FIGURES, check_output, check_result
from modelgen.errors import DataError

Sources = Annotated[
    list[Path],
    typer.Argument(
        metavar="HISTORY", help="Projects (.toml), histories (.jsonl); or saved estimates (.json), in order."
    ),
]
Plot = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Draw all quantities of one machine: png, svg, pdf.")
]
Check = Annotated[bool, typer.Option("--check", help="Exit with 1 if anything has changed.")]


def trend(
    sources: Sources,
    plot: Plot = None,
    check: Check = False,
    *,
    result: ResultOptions,
) -> None:
    """Test which parameters and modes of a machine have changed, since when, and by how much.

    Of histories without a change 5 % are said to have one, all quantities taken together. Of several
    estimates from the same records the last one counts.
    """
    from modelgen.cli.figure import write_picture
    from modelgen.cli.project.trend_sources import machines_of
    from modelgen.cli.project.trend_tables import describe, trend_tables
    from modelgen.cli.tables import console
    from modelgen.runtime.plots.trend_plots import draw_trend
    from modelgen.runtime.trend.trend import trend as find

    check_result(result)
    if plot is not None:
        check_output(plot, FIGURES, result.overwrite)
    machines = machines_of(sources)
    if plot is not None and len(machines) > 1:
        raise DataError.at("--plot", f"draws one machine, here are {len(machines)}", "give one of them")
    found = [find(machine.estimates, machine.labels) for machine in machines]
    if plot is not None:
        write_picture(draw_trend(found[0]), plot, result.overwrite)
    described = [describe(machine, one) for machine, one in zip(machines, found, strict=True)]
    deliver({"machines": described}, lambda: console().print(trend_tables(described)), result)
    if check and any(one.changed for one in found):
        raise typer.Exit(1)
