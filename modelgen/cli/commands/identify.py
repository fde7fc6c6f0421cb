"""`modelgen identify`: parameters of a generated module from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.arguments import amounts, given_options
from modelgen.cli.arms.compared_arm import inputs_of_loop
from modelgen.cli.data_arguments import DataOptions, reading_lines
from modelgen.cli.estimation_options import EstimationOptions, FullOptions, Payloads, Tags, settings_typed
from modelgen.cli.options import Data, Details, Json, Overwrite, Trust, Values
from modelgen.cli.output import note, print_json
from modelgen.cli.result_pages.write_page import ReportFile
from modelgen.errors import IdentifiabilityError

Modules = Annotated[
    list[Path] | None,
    typer.Option(
        "--model", metavar="MODULE.py", help="A generated module; several for records of several sensor sets."
    ),
]
SensorsOf = Annotated[
    list[str] | None,
    typer.Option(
        "--sensors",
        metavar="S|RECORD=S",
        help="Sensor set of all records or of one, where files do not show it; repeatable.",
    ),
]
Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE.json", help="Save the estimate.")
]
FigureFile = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Draw measured and rebuilt forces: png, svg, pdf.")
]
ReportSpec = Annotated[
    str | None,
    typer.Option(metavar="SPEC", help="The chain: in place of --model, and for the report's sensor sets."),
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
    module: Modules = None,
    *,
    given: DataOptions,
    estimation: EstimationOptions,
    full: FullOptions,
    tag: Tags = None,
    payload: Payloads = None,
    sensors: SensorsOf = None,
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
    """Identify a chain's parameters from measured records.

    Records of different sensors, each with the channels of a sensor set, are joined to one answer.
    Prints parameters, modes, whether to trust them and what to do next. What is "chosen" is chosen from the
    records, unless it is given; --details explains it.
    """
    from modelgen.cli.output_files import OutputFiles, refuse_idle
    from modelgen.cli.project.from_options import save_project
    from modelgen.cli.sensor_sets.identified import identified, models_of, read_for, sensors_from

    refuse_idle(report_file, {"--controller": controller, "--spec": spec if module else None})
    wanted, of_records = sensors_from(sensors or ())
    models = models_of(module or (), spec, wanted, amounts("--set", value or ()), trust, data)
    outputs = OutputFiles(output, report_file, figure, overwrite, project_file)
    of_arm = any(model.is_arm for model in models.values())
    outputs.check(spec, controller, of_arm)  # before the work, not after it
    inputs = inputs_of_loop(next(iter(models.values()))) if controller and report_file else ()
    read = read_for(data, models, given, tag or (), of_records, inputs, payload or ())
    readings = reading_lines(data, [one for _, one in read])
    try:
        found = identified(models, read, settings_typed(context.params))
    except IdentifiabilityError:
        note(readings)  # what was found in the files may be why
        raise
    note(readings)
    # before the files: whatever becomes of these, the answer is there
    if as_json:
        print_json(found.estimate.to_dict())
    else:
        typer.echo(found.text(details), nl=False)
    outputs.write(found, module[0] if module else Path(str(spec)), given_options(context), spec, controller)
    save_project(outputs, context.params)
    note([f"wrote {path}" for path in outputs.paths])
