"""`modelgen validate`: simulated against measured signals, on records used and held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from modelgen.cli.data_arguments import BESIDE_REFERENCE, REFERENCE, DataOptions, read_files, reading_lines
from modelgen.cli.options import (
    Columns,
    Data,
    Json,
    MapFile,
    Mend,
    Module,
    SamplingFrequency,
    Scales,
    TimeColumn,
    TimeUnit,
    Trust,
)
from modelgen.cli.output import note, print_json, say
from modelgen.errors import DataError

if TYPE_CHECKING:
    from rich.console import Group

    from modelgen.runtime.simulation.validate import Validation


EstimateFile = Annotated[
    Path, typer.Option("--estimate", metavar="FILE.json", help="What identify -o wrote.")
]
Controller = Annotated[
    Path, typer.Option(metavar="FILE.toml", help="The loop: tables [controller] and [drive].")
]
Values = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter the estimate lacks, SI; repeatable."),
]
Cutoff = Annotated[
    float | None, typer.Option(help="Cut-off in Hz before a reading is differentiated; 0.1 fs.")
]
HoldOut = Annotated[
    float | None,
    typer.Option(metavar="SHARE", help="Also identify from this first share alone, validate on the rest."),
]


def validate(
    data: Data,
    module: Module,
    estimate: EstimateFile,
    controller: Controller,
    mapping: Columns = None,
    scale: Scales = None,
    map_file: MapFile = None,
    fs: SamplingFrequency = None,
    time: TimeColumn = None,
    time_unit: TimeUnit = None,
    mend: Mend = None,
    value: Values = None,
    cutoff_hz: Cutoff = None,
    oversample: Annotated[int | None, typer.Option(help="Internal steps per sample; 8, sampled 1.")] = None,
    hold_out: HoldOut = None,
    trust: Trust = False,
    as_json: Json = False,
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

    model = load_model(module, trust)
    loop, drive = load_controller(controller)
    saved = load_estimate(estimate)
    parameters = {**parameters_of(saved, model), **amounts("--set", value or ())}
    given = DataOptions(mapping or (), scale or (), fs, time, time_unit, map_file, mend or ())
    readings = read_files(data, model, given, REFERENCE, BESIDE_REFERENCE)
    note(reading_lines(data, readings))
    records = [reading.record for reading in readings]
    options: dict[str, Any] = {"drive": drive, "cutoff_hz": cutoff_hz, "oversample": oversample}
    say("simulating")
    found = run(model, parameters, records, loop, used=tuple(saved.get("records", ())), **options)
    if hold_out is not None:
        if "method" not in saved:
            remedy = "give a file that modelgen identify -o wrote"
            raise DataError.at(f"{estimate}: method", "is missing", remedy)
        first, rest = zip(*(split(record, hold_out) for record in records), strict=True)
        again = identify(model, first, method=saved["method"], progress=say)
        found += run(model, {**parameters, **again.physical}, rest, loop, **options)
    described = describe(found)
    if as_json:
        print_json(described)
    else:
        console().print(validation_tables(described))


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
