"""`modelgen validate`: simulated against measured signals, on records used and held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from modelgen.cli.data_arguments import FURTHER_INPUTS, REFERENCE, DataOptions, read_files, reading_lines
from modelgen.cli.estimation_options import EstimationOptions, MethodName
from modelgen.cli.options import Data, Module, ResultOptions, Trust, Values, refuse_given
from modelgen.cli.output import deliver, note
from modelgen.cli.output_files import check_result
from modelgen.errors import DataError
from modelgen.progress import step

if TYPE_CHECKING:
    from rich.console import Group

    from modelgen.runtime.simulation.validate import Validation


EstimateFile = Annotated[
    Path, typer.Option("--estimate", metavar="FILE.json", help="What identify -o wrote.")
]
Controller = Annotated[
    Path, typer.Option(metavar="FILE.toml", help="The loop: tables [controller] and [drive].")
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
    data: Data,
    module: Module,
    estimate: EstimateFile,
    controller: Controller,
    given: DataOptions,
    estimation: EstimationOptions,
    value: Values = None,
    cutoff_hz: Cutoff = None,
    oversample: Annotated[int | None, typer.Option(help="Internal steps per sample; 8, sampled 1.")] = None,
    hold_out: HoldOut = None,
    method: OwnMethod = None,
    identify_cutoff_hz: OwnCutoff = None,
    trust: Trust = False,
    *,
    result: ResultOptions,
) -> None:
    """Validate an estimate in closed loop: simulate the records' reference, compare all signals.

    A record is held out if its name is none of those that the estimate was identified from.
    """
    from modelgen.cli.arguments import amounts
    from modelgen.cli.tables import console
    from modelgen.runtime.identification.identify import identify
    from modelgen.runtime.model.model import load_model
    from modelgen.runtime.results.estimate_file import load_estimate
    from modelgen.runtime.simulation.controller_file import load_controller
    from modelgen.runtime.simulation.validate import parameters_of, split
    from modelgen.runtime.simulation.validate import validate as run

    check_result(result)
    if hold_out is None:
        refuse_given(estimation, "--hold-out", (method, identify_cutoff_hz))
    model = load_model(module, trust)
    loop, drive = load_controller(controller)
    saved = load_estimate(estimate)
    parameters = {**parameters_of(saved, model), **amounts("--set", value or ())}
    readings = read_files(data, [model], given, REFERENCE, FURTHER_INPUTS)
    note(reading_lines(data, readings))
    records = [reading.record for reading in readings]
    options: dict[str, Any] = {"drive": drive, "cutoff_hz": cutoff_hz, "oversample": oversample}
    step("simulating")
    found = run(model, parameters, records, loop, used=tuple(saved.get("records", ())), **options)
    if hold_out is not None:
        if method is None and "method" not in saved:
            remedy = "give --method, or a file that modelgen identify -o wrote"
            raise DataError.at(f"{estimate}: method", "is missing", remedy)
        first, rest = zip(*(split(record, hold_out) for record in records), strict=True)
        settings = estimation.settings(method or saved["method"], given, cutoff_hz=identify_cutoff_hz)
        again = identify(model, first, **settings)
        found += run(model, {**parameters, **again.physical}, rest, loop, **options)
    described = describe(found)
    deliver(described, lambda: console().print(validation_tables(described)), result)


def describe(validations: Sequence[Validation]) -> dict[str, Any]:
    """Return validations as plain values."""
    return {
        "records": [
            {
                "record": v.record,
                "held_out": v.held_out,
                "fs_hz": v.fs,
                "cutoff_hz": v.cutoff_hz,
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

    from modelgen.cli.tables import table

    parts = []
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
        heading = f"{entry['record']}, {kind}; derivatives below {entry['cutoff_hz']:.4g} Hz"
        columns: list[tuple[str, Literal["left", "right"]]] = [
            ("signal", "left"),
            ("error %", "right"),
            ("fit %", "right"),
            ("rms error", "right"),
        ]
        parts.append(table(heading, columns, rows))
    return Group(*parts)
