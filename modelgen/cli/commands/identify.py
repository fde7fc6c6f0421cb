"""`modelgen identify`: parameters of a generated module from measured records."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from modelgen.cli.arguments import cutoffs_from, delays_from, given_options, hold_out_from, period_from
from modelgen.cli.data_arguments import (
    BESIDE_REFERENCE,
    REFERENCE,
    DataOptions,
    direction_sources,
    read_files,
    reading_lines,
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

Method = Annotated[
    Literal["wls", "iv", "tls", "pham2002"],
    typer.Option(
        help="Matched filters, on them instrumental variables or total least squares; or the paper."
    ),
]
Directions = Annotated[
    list[str] | None,
    typer.Option(metavar="sign_BODY=CHANNEL", help="A channel that moves with a body; repeatable."),
]
Tags = Annotated[
    list[str] | None, typer.Option(metavar="RECORD=TAG", help="Tag of a record, for --pairing; repeatable.")
]
Pairing = Annotated[
    Literal["all", "pham2002"],
    typer.Option(
        help="Every record feeds every row, or chirps the differentiated rows and trapezoids the rest."
    ),
]
Cutoff = Annotated[float | None, typer.Option(help="Cut-off in Hz of the low-pass; chosen.")]
FilterOrder = Annotated[int | None, typer.Option(help="Order of the low-pass; chosen.")]
Decimation = Annotated[int | None, typer.Option(help="Keep every N-th sample; chosen.")]
DirectionCutoff = Annotated[float | None, typer.Option(help="Cut-off in Hz of directions of motion; chosen.")]
Drop = Annotated[int | None, typer.Option(help="Samples left out at the beginning of a record.")]
Delays = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=SECONDS|estimate|none", help="How late a force is; iv estimates it; repeatable."
    ),
]
Held = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY", help="A force that is a command behind a zero-order hold; repeatable."),
]
PrunePercent = Annotated[
    float, typer.Option(help="Relative std. deviation in % from which parameters are pruned.")
]
ResidualDof = Annotated[
    Literal["r-c", "r-1"], typer.Option(help="Degrees of freedom of the residual in eq. (11).")
]
Keep = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="A parameter not to prune, and not to refuse on doubt; repeatable."),
]
Periods = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SECONDS|RECORD=SECONDS|none", help="Period of the excitation; found in the forces."
    ),
]
HoldOut = Annotated[
    list[str] | None,
    typer.Option(metavar="RECORD|SHARE", help="Records, or the end of all, to test with; repeatable."),
]
ScanCutoffs = Annotated[
    str | None,
    typer.Option(metavar="auto|HZ,HZ,...", help="Estimate behind other filters, too, and compare."),
]
Robust = Annotated[Literal["huber"] | None, typer.Option(help="Samples with large residuals weigh less.")]
Bounds = Annotated[
    Literal["physical"] | None, typer.Option(help="No negative inertia, stiffness, damping, friction.")
]
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

# options that go on to the estimation as they are
PASSED_ON = (
    "method",
    "cutoff_hz",
    "filter_order",
    "decimation",
    "direction_cutoff_hz",
    "drop",
    "prune_percent",
    "residual_dof",
    "robust",
    "bounds",
)


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
    settings = _settings(context.params) | {"directions": direction_sources(options)}
    estimate = run(model, [reading.record for reading in readings], progress=say, **settings)
    outputs.write(model, module, readings, estimate, given_options(context), spec, controller)
    note(reading_lines(data, readings))
    note([f"wrote {path}" for path in outputs.paths])
    if as_json:
        print_json(estimate.to_dict())
    else:
        typer.echo(estimate.summary(), nl=False)


def _settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of the estimation from the command's options, by the names of their parameters."""
    return {name: given[name] for name in PASSED_ON} | {
        "delays": delays_from(given["delay"] or ()),
        "held": given["held"] or (),
        "rows_for_tag": None if given["pairing"] == "all" else given["pairing"],
        "keep": given["keep"] or (),
        "period_s": period_from(given["period_s"] or (), given["map_file"]),
        "hold_out": hold_out_from(given["hold_out"] or ()),
        "scan_cutoffs": cutoffs_from(given["scan_cutoffs"]),
    }
