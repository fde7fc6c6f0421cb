"""`modelgen identify`: parameters of a generated module from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.arguments import given_options
from modelgen.cli.data_arguments import (
    BESIDE_REFERENCE,
    REFERENCE,
    DataOptions,
    read_files,
    reading_lines,
)
from modelgen.cli.estimation_options import (
    Bounds,
    Cutoff,
    Decimation,
    Delays,
    DirectionCutoff,
    Directions,
    Drop,
    FilterOrder,
    Held,
    HoldOut,
    Keep,
    Method,
    Pairing,
    Periods,
    PrunePercent,
    ResidualDof,
    Robust,
    ScanCutoffs,
    Tags,
    estimation_settings,
)
from modelgen.cli.options import (
    Columns,
    Data,
    Json,
    MapFile,
    Mend,
    Module,
    Overwrite,
    SamplingFrequency,
    Scales,
    TimeColumn,
    TimeUnit,
    Trust,
)
from modelgen.cli.output import note, print_json, say

Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE.json", help="Save the estimate.")
]
ReportFile = Annotated[
    Path | None, typer.Option("--report", metavar="FILE.html", help="Write everything as one HTML page.")
]
FigureFile = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Draw measured and rebuilt forces: png, svg, pdf.")
]
ReportSpec = Annotated[
    str | None, typer.Option(metavar="SPEC", help="The chain, for the report's table of sensor sets.")
]
Controller = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="The loop, for the report's overlay; needs column reference."),
]


def identify(
    context: typer.Context,
    data: Data,
    module: Module,
    method: Method = "wls",
    mapping: Columns = None,
    scale: Scales = None,
    map_file: MapFile = None,
    fs: SamplingFrequency = None,
    time: TimeColumn = None,
    time_unit: TimeUnit = None,
    mend: Mend = None,
    direction: Directions = None,
    tag: Tags = None,
    pairing: Pairing = "all",
    cutoff_hz: Cutoff = None,
    filter_order: FilterOrder = None,
    decimation: Decimation = None,
    direction_cutoff_hz: DirectionCutoff = None,
    drop: Drop = None,
    delay: Delays = None,
    held: Held = None,
    prune_percent: PrunePercent = 10.0,
    residual_dof: ResidualDof = "r-c",
    keep: Keep = None,
    period_s: Periods = None,
    hold_out: HoldOut = None,
    scan_cutoffs: ScanCutoffs = None,
    robust: Robust = None,
    bounds: Bounds = None,
    output: Output = None,
    report_file: ReportFile = None,
    figure: FigureFile = None,
    spec: ReportSpec = None,
    controller: Controller = None,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Identify a generated module's parameters from measured records.

    What is "chosen" is chosen from the records and explained in the output, unless it is given.
    """
    from modelgen.cli.output_files import OutputFiles
    from modelgen.runtime.identification.identify import identify as run
    from modelgen.runtime.model.model import load_model

    model = load_model(module, trust)
    options = DataOptions(
        mapping or (), scale or (), fs, time, time_unit, map_file, mend or (), direction or (), tag or ()
    )
    outputs = OutputFiles(output, report_file, figure, overwrite)
    outputs.check()  # before the work, not after it
    inputs = (REFERENCE, BESIDE_REFERENCE) if controller and report_file else ()
    readings = read_files(data, model, options, *inputs)
    settings = estimation_settings(context.params)
    estimate = run(model, [reading.record for reading in readings], progress=say, **settings)
    outputs.write(model, module, readings, estimate, given_options(context), spec, controller)
    note(reading_lines(data, readings))
    note([f"wrote {path}" for path in outputs.paths])
    if as_json:
        print_json(estimate.to_dict())
    else:
        typer.echo(estimate.summary(), nl=False)
