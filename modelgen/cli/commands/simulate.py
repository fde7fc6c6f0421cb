"""`modelgen simulate`: records of a chain in closed loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.arguments import amounts, excitation_from, load_chain, parameter_values
from modelgen.cli.options import Json, Noise, Overwrite, ParameterSet, Resolution, Spec
from modelgen.cli.output import report

Excitation = Annotated[
    str,
    typer.Option(
        metavar="KIND",
        help="chirp, trapezoid, or a data file with columns reference, reference_rate or feedforward, "
        "and the forces of actuators behind the first.",
    ),
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="DATA", help="A .csv or .npz file to write.")]
SamplingFrequency = Annotated[
    float | None,
    typer.Option(
        "--fs",
        "--fs-hz",
        metavar="HZ",
        help="Sampling frequency in Hz; 5000, or the file's.",
    ),
]
Duration = Annotated[
    float | None, typer.Option(metavar="SECONDS", help="Duration in s of chirp or trapezoid; 2 s.")
]
Bias = Annotated[
    list[str] | None, typer.Option(metavar="KEY=ERROR", help="Constant error of a channel, SI; repeatable.")
]
Controller = Annotated[
    Path | None, typer.Option(metavar="FILE.toml", help="The loop; one slow against the lowest mode.")
]
WithReference = Annotated[
    bool, typer.Option("--with-reference", help="Also write the inputs of the loop, for validate.")
]


def simulate(
    spec: Spec,
    sensors: Annotated[str, typer.Option("--sensors", metavar="S", help="The sensor set that records.")],
    excitation: Excitation,
    data: Output,
    parameters: ParameterSet = None,
    fs_hz: SamplingFrequency = None,
    duration_s: Duration = None,
    noise: Noise = None,
    resolution: Resolution = None,
    bias: Bias = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise; every excitation draws its own.")] = 0,
    controller: Controller = None,
    with_reference: WithReference = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Simulate a chain in closed loop and write what its sensors read.

    Friction is true stick and slip; the levels of chirp and trapezoid follow from the parameters. The loop
    drives the first actuator; others follow the excitation's file, or rest.
    """
    from modelgen.render.writer import generate as module_text
    from modelgen.render.writer import module_name
    from modelgen.runtime.model.model import model_from_text
    from modelgen.runtime.records.write_record import write_record
    from modelgen.runtime.simulation.controller_file import load_controller
    from modelgen.runtime.simulation.simulate import record_with_reference
    from modelgen.runtime.simulation.simulate import simulate as run

    chain = load_chain(spec)
    model = model_from_text(module_text(chain, sensors), module_name(chain, sensors))
    signal, file_fs = excitation_from(excitation, [actuator.key for actuator in model.actuators[1:]])
    loop, drive = load_controller(controller) if controller else (None, None)
    result = run(
        model,
        parameter_values(chain, parameters),
        signal,
        fs=fs_hz or file_fs or 5000.0,
        duration_s=duration_s,
        noise=amounts("--noise", noise or ()),
        resolution=amounts("--resolution", resolution or ()),
        bias=amounts("--bias", bias or ()),
        seed=seed,
        controller=loop,
        drive=drive,
    )
    record = record_with_reference(result) if with_reference else result.record
    write_record(data, record, overwrite=overwrite)
    facts = {
        "written": [str(data)],
        "fs_hz": record.fs,
        "samples": record.n,
        "channels": list(record.signals),
    }
    line = f"wrote {data}: {', '.join(record.signals)}; {record.n} samples at {record.fs:g} Hz"
    report(facts, [line], as_json)
