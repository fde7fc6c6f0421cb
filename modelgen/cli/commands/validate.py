"""`modelgen validate`: simulated against measured signals, on records used and held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.arms.compared_arm import arm_comparison, inputs_of_loop
from modelgen.cli.data_arguments import DataOptions, carrying, read_files, reading_lines
from modelgen.cli.estimation_options import EstimationOptions, MethodName, Payloads, settings_typed
from modelgen.cli.options import Data, Module, ResultOptions, Trust, Values, refuse_given
from modelgen.cli.output import deliver, note
from modelgen.cli.output_files import check_result
from modelgen.cli.result_pages.write_page import ReportFile, check_report, write_result_page
from modelgen.errors import DataError
from modelgen.progress import step

if TYPE_CHECKING:
    from rich.console import Group

    from modelgen.runtime.model.model import Model
    from modelgen.runtime.simulation.validation import Validation


EstimateFile = Annotated[
    Path, typer.Option("--estimate", metavar="FILE.json", help="What identify -o wrote.")
]
Controller = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="The loop: tables [controller] and [drive]; else open loop."),
]
Horizon = Annotated[
    int | None,
    typer.Option(metavar="K", help="Predict K samples ahead; else open loop over the record."),
]
Cutoff = Annotated[
    float | None, typer.Option(help="Cut-off in Hz before a reading is differentiated; 0.1 fs.")
]
HoldOut = Annotated[
    float | None,
    typer.Option(metavar="SHARE", help="Also identify from this first share alone, validate on the rest."),
]
OwnMethod = Annotated[MethodName | None, typer.Option(help="How --hold-out identifies; as the estimate was.")]
OwnCutoff = Annotated[float | None, typer.Option(help="Its cut-off in Hz; chosen.")]


def validate(
    context: typer.Context,
    data: Data,
    module: Module,
    estimate: EstimateFile,
    given: DataOptions,
    estimation: EstimationOptions,
    controller: Controller = None,
    horizon: Horizon = None,
    value: Values = None,
    payload: Payloads = None,
    cutoff_hz: Cutoff = None,
    oversample: Annotated[int | None, typer.Option(help="Internal steps per sample; 8, sampled 1.")] = None,
    hold_out: HoldOut = None,
    method: OwnMethod = None,
    identify_cutoff_hz: OwnCutoff = None,
    report_file: ReportFile = None,
    trust: Trust = False,
    *,
    result: ResultOptions,
) -> None:
    """Validate an estimate: simulate the records with it, and compare all signals.

    With a controller its loop follows the records' reference; without one the chain moves under the measured
    forces, in open loop over the whole record, or --horizon samples ahead. Of an arm the forces that
    its motion needs are compared then.
    A record is held out if the estimate was not identified from its samples, whatever its name.
    """
    from modelgen.cli.arguments import amounts
    from modelgen.cli.tables import console
    from modelgen.runtime.identification.identify import identify
    from modelgen.runtime.model.known_parameters import as_identified
    from modelgen.runtime.model.model import load_model
    from modelgen.runtime.results.estimate_file import load_estimate
    from modelgen.runtime.simulation.validate import parameters_of, split

    check_result(result)
    check_report(report_file, result.overwrite)
    if hold_out is None:
        refuse_given(estimation, "--hold-out", (method, identify_cutoff_hz))
    model = load_model(module, trust)
    compared = _comparison(model, controller, horizon, {"cutoff_hz": cutoff_hz, "oversample": oversample})
    saved = load_estimate(estimate)
    given_values = amounts("--set", value or ())
    parameters = {**parameters_of(saved, model), **given_values}
    inputs = inputs_of_loop(model) if controller else ()
    readings = carrying(read_files(data, [model], given, *inputs), payload or (), [model])
    note(reading_lines(data, readings))
    records = [reading.record for reading in readings]
    step("simulating")
    found = compared(parameters, records, tuple(saved.get("contents") or saved.get("records", ())))
    if hold_out is not None:
        if method is None and "method" not in saved:
            remedy = "give --method, or a file that modelgen identify -o wrote"
            raise DataError.at(f"{estimate}: method", "is missing", remedy)
        first, rest = zip(*(split(record, hold_out) for record in records), strict=True)
        own = {"method": method or saved["method"], "cutoff_hz": identify_cutoff_hz}
        settings = settings_typed({**context.params, **own, "hold_out": None, "map_file": None})
        held = {**saved.get("known", {}), **given_values}
        again = identify(as_identified(model, held), first, **settings)
        found += compared({**parameters, **parameters_of(again, model)}, rest)
    described = describe(found)
    deliver(described, lambda: console().print(validation_tables(described)), result)
    title = f"{model.chain}, sensors {model.sensor_set}: measured and simulated"
    printed = validation_tables(described)
    write_result_page(report_file, result.overwrite, title, printed, context, validations=found)


def _comparison(
    model: Model, controller: Path | None, horizon: int | None, options: Mapping[str, Any]
) -> Callable[..., tuple[Validation, ...]]:
    """Return what simulates records with parameters: in the controller's loop, or under measured forces."""
    from modelgen.runtime.prediction.compare import compare
    from modelgen.runtime.simulation.controller_file import load_controller
    from modelgen.runtime.simulation.validate import validate as run

    if model.is_arm:
        return arm_comparison(model, controller, {"--horizon": horizon, **options})
    if controller is None:
        if any(value is not None for value in options.values()):
            remedy = "give --controller, or leave them out"
            raise DataError.at("--cutoff-hz, --oversample", "are settings of a closed loop", remedy)
        return lambda values, records, used=(): compare(model, values, records, horizon, used)
    if horizon is not None:
        raise DataError.at("--horizon", "predicts without a loop", "leave out --controller, or --horizon")
    loop, drive = load_controller(controller)
    return lambda values, records, used=(): run(
        model, values, records, loop, drive=drive, used=used, **options
    )


def describe(validations: Sequence[Validation]) -> dict[str, Any]:
    """Return validations as plain values."""
    return {
        "records": [
            {
                "record": v.record,
                "held_out": v.held_out,
                "fs_hz": v.fs,
                "cutoff_hz": v.cutoff_hz,
                "comparison": v.kind,
                "notes": list(v.notes),
                "signals": [
                    {
                        "channel": c.channel,
                        "signal": c.kind,
                        "unit": c.unit,
                        "derived": c.derived,
                        "relative_error_percent": c.relative_error,
                        "fit_percent": c.fit,
                        "rms_error": c.rms_error,
                    }
                    for c in v.checks
                ],
            }
            for v in validations
        ]
    }


def validation_tables(described: Mapping[str, Any]) -> Group:
    """Lay out what `describe` says, one table a record."""
    from rich.console import Group
    from rich.text import Text

    from modelgen.cli.tables import table

    parts: list[Any] = []
    for entry in described["records"]:
        kind = "held out" if entry["held_out"] else "used"
        rows = [
            (
                f"{s['channel']}: {s['signal']}" + (" (derived)" if s["derived"] else ""),
                f"{s['relative_error_percent']:.5g}",
                f"{s['fit_percent']:.5g}",
                f"{s['rms_error']:.3g} {s['unit']}",
            )
            for s in entry["signals"]
        ]
        below = f"; derivatives below {entry['cutoff_hz']:.4g} Hz"
        derived = below if any(s["derived"] for s in entry["signals"]) else ""
        heading = f"{entry['record']}, {kind}; {entry['comparison']}{derived}"
        parts.append(table(heading, ("signal", ">error %", ">fit %", ">rms error"), rows))
        parts += [Text(line) for line in entry["notes"]]
    return Group(*parts)
