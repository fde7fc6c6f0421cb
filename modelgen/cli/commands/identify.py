"""`modelgen identify`: parameters of a generated module from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.arguments import amounts, cutoffs_from, given_options, hold_out_from, period_from
from modelgen.cli.data_arguments import (
    FURTHER_INPUTS,
    REFERENCE,
    DataOptions,
    read_files,
    reading_lines,
    tagged,
)
from modelgen.cli.estimation_options import (
    Cutoff,
    EstimationOptions,
    HoldOut,
    Method,
    Pairing,
    Periods,
    PrunePercent,
    ScanCutoffs,
    Tags,
)
from modelgen.cli.options import Data, Details, Json, Module, Overwrite, Trust, Values
from modelgen.cli.output import note, print_json

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
SaveProject = Annotated[
    Path | None,
    typer.Option("--save-project", metavar="FILE.project.toml", help="Write these options for modelgen run."),
]


def identify(
    context: typer.Context,
    data: Data,
    module: Module,
    given: DataOptions,
    estimation: EstimationOptions,
    method: Method = "auto",
    cutoff_hz: Cutoff = None,
    tag: Tags = None,
    pairing: Pairing = "all",
    prune_percent: PrunePercent = 10.0,
    period_s: Periods = None,
    hold_out: HoldOut = None,
    scan_cutoffs: ScanCutoffs = None,
    value: Values = None,
    output: Output = None,
    report_file: ReportFile = None,
    figure: FigureFile = None,
    spec: ReportSpec = None,
    controller: Controller = None,
    project_file: SaveProject = None,
    details: Details = False,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Identify a generated module's parameters from measured records.

    Prints parameters, modes, whether to trust them and what to do next. What is "chosen" is chosen from the
    records, unless it is given; --details explains it.
    """
    from modelgen.cli.output_files import OutputFiles
    from modelgen.cli.project.from_options import save_project
    from modelgen.runtime.identification.identify import identify as run
    from modelgen.runtime.model.known_parameters import with_known
    from modelgen.runtime.model.model import load_model

    model = with_known(load_model(module, trust), amounts("--set", value or ()), "--set")
    outputs = OutputFiles(output, report_file, figure, overwrite, project_file)
    outputs.check(spec, controller)  # before the work, not after it
    inputs = (REFERENCE, FURTHER_INPUTS) if controller and report_file else ()
    readings = tagged(read_files(data, [model], given, *inputs), tag or ())
    settings = estimation.settings(
        method,
        given,
        cutoff_hz=cutoff_hz,
        rows_for_tag=None if pairing == "all" else pairing,
        prune_percent=prune_percent,
        period_s=period_from(period_s or (), given.map_file),
        hold_out=hold_out_from(hold_out or ()),
        scan_cutoffs=cutoffs_from(scan_cutoffs),
    )
    estimate = run(model, [reading.record for reading in readings], **settings)
    note(reading_lines(data, readings))
    # before the files: whatever becomes of these, the answer is there
    if as_json:
        print_json(estimate.to_dict())
    else:
        typer.echo(estimate.summary() if details else estimate.answer(), nl=False)
    outputs.write(model, module, readings, estimate, given_options(context), spec, controller)
    save_project(outputs, context.params)
    note([f"wrote {path}" for path in outputs.paths])
