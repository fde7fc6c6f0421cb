"""`modelgen export`: a model with identified numbers in the format of another tool."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from modelgen.cli.options import Json, Module, Overwrite, Trust, Values
from modelgen.cli.output import report
from modelgen.errors import DataError

EstimateFile = Annotated[
    Path | None, typer.Argument(metavar="ESTIMATE.json", help="What identify -o wrote; or give --parameters.")
]
Format = Annotated[
    Literal["state-space", "matlab", "fmu", "modelica", "mjcf", "urdf"],
    typer.Option("--to", help="The format."),
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write.")]
Set = Annotated[
    str | None, typer.Option(metavar="SET", help="A parameter set of the spec in place of an estimate.")
]
Samples = Annotated[
    int, typer.Option(metavar="N", min=0, help="Also N sets of parameters drawn from the covariance.")
]


def export(
    module: Module,
    to: Format,
    output: Output,
    estimate: EstimateFile = None,
    parameters: Set = None,
    value: Values = None,
    samples: Samples = 0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the samples.")] = 0,
    overwrite: Overwrite = False,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Write a model with identified numbers for another tool.

    A parameter that the records do not determine is named, with what to give for it. Samples with negative
    inertia, stiffness, damping or friction are drawn again.
    """
    from modelgen.cli.arguments import amounts
    from modelgen.runtime.exports.export import export as run
    from modelgen.runtime.model.model import load_model
    from modelgen.runtime.results.estimate import Estimate

    if (estimate is None) == (parameters is None):
        what = "are both given" if estimate else "are both missing"
        raise DataError.at("ESTIMATE.json and --parameters", what, "give one of them")
    model = load_model(module, trust)
    source = Estimate.load(estimate) if estimate else str(parameters)
    found = run(model, source, to, values=amounts("--set", value or ()), samples=samples, seed=seed)
    paths = [str(path) for path in found.save(output, overwrite=overwrite)]
    facts = {
        "written": paths,
        "parameters": {
            name: {"value": size, "origin": found.values.origin[name]}
            for name, size in found.values.nominal.items()
        },
        "notes": list(found.notes),
    }
    report(facts, [*(f"wrote {path}" for path in paths), *(f"note: {note}" for note in found.notes)], as_json)
