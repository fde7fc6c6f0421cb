"""`modelgen simulate`: records of a chain or an arm in closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.arguments import amounts, excitation_from, load_chain_or_arm, parameter_values
from modelgen.cli.arms.simulate_arm import simulated_arm
from modelgen.cli.options import Json, Noise, Overwrite, ParameterSet, Resolution, SpecOfAny
from modelgen.cli.output import report
from modelgen.cli.output_files import check_output
from modelgen.errors import DataError

if TYPE_CHECKING:
    from modelgen.runtime.records.record import Record
    from modelgen.spec.chain import ChainSpec

Excitation = Annotated[
    str,
    typer.Option(
        metavar="KIND",
        help="chirp, trapezoid, or a data file with columns reference, reference_rate or feedforward, "
        "and the forces of actuators behind the first. Of an arm: fourier, or a file with columns q_NAME.",
    ),
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="DATA", help="A .csv or .npz file to write.")]
SamplingFrequency = Annotated[
    float | None,
    typer.Option(
        "--fs",
        "--fs-hz",
        metavar="HZ",
        help="Sampling frequency in Hz; 5000 (of an arm 1000), or the file's.",
    ),
]
Duration = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Duration in s of chirp, trapezoid (2) or fourier (10)."),
]
Bias = Annotated[
    list[str] | None, typer.Option(metavar="KEY=ERROR", help="Constant error of a channel, SI; repeatable.")
]
Controller = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="The loop; slow against the lowest mode, of an arm PD."),
]
WithReference = Annotated[
    bool, typer.Option("--with-reference", help="Also write the inputs of the loop, for validate.")
]


Recorded = Annotated[
    str | None,
    typer.Option("--sensors", metavar="S", help="The sensor set that records; of a rigid arm its joints."),
]


Carried = Annotated[
    list[str] | None,
    typer.Option("--payload", metavar="NAME", help="What an arm carries all the time; repeatable."),
]


def simulate(
    context: typer.Context,
    spec: SpecOfAny,
    excitation: Excitation,
    data: Output,
    sensors: Recorded = None,
    parameters: ParameterSet = None,
    fs_hz: SamplingFrequency = None,
    duration_s: Duration = None,
    noise: Noise = None,
    resolution: Resolution = None,
    bias: Bias = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise; every excitation draws its own.")] = 0,
    controller: Controller = None,
    with_reference: WithReference = False,
    payload: Carried = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Simulate a chain or an arm in closed loop and write what its sensors read.

    Friction is true stick and slip; the levels of chirp and trapezoid follow from the parameters. The loop
    drives the first actuator; others follow the excitation's file, or rest. Of an arm it drives all joints.
    """
    from modelgen.runtime.records.write_record import write_record
    from modelgen.spec.arms.arm import ArmSpec

    check_output(data, (".csv", ".npz"), overwrite)
    chain = load_chain_or_arm(spec)
    if isinstance(chain, ArmSpec):
        record = simulated_arm(chain, context.params)
    else:
        record = _simulated_chain(chain, context.params)
    write_record(data, record, overwrite=overwrite)
    facts = {
        "written": [str(data)],
        "fs_hz": record.fs,
        "samples": record.n,
        "channels": list(record.signals),
    }
    line = f"wrote {data}: {', '.join(record.signals)}; {record.n} samples at {record.fs:g} Hz"
    report(facts, [line], as_json)


def _simulated_chain(chain: ChainSpec, given: Mapping[str, Any]) -> Record:
    """Return the record of a simulation with the options of the command."""
    from modelgen.cli.candidates import spec_model
    from modelgen.runtime.simulation.controller_file import load_controller
    from modelgen.runtime.simulation.simulate import record_with_reference
    from modelgen.runtime.simulation.simulate import simulate as run

    sensors = given["sensors"]
    if given["payload"]:
        raise DataError.at("--payload", f"is for arms, and {chain.name} is a chain", "leave it out")
    if sensors is None:
        remedy = f"choose one of {', '.join(chain.sensor_sets)}"
        raise DataError.at("--sensors", "is missing", remedy if chain.sensor_sets else "write [sensors.NAME]")
    model = spec_model(chain, sensors)
    signal, file_fs = excitation_from(given["excitation"], [one.key for one in model.actuators[1:]])
    loop, drive = load_controller(given["controller"]) if given["controller"] else (None, None)
    result = run(
        model,
        parameter_values(chain, given["parameters"]),
        signal,
        fs=given["fs_hz"] or file_fs or 5000.0,
        duration_s=given["duration_s"],
        noise=amounts("--noise", given["noise"] or ()),
        resolution=amounts("--resolution", given["resolution"] or ()),
        bias=amounts("--bias", given["bias"] or ()),
        seed=given["seed"],
        controller=loop,
        drive=drive,
    )
    return record_with_reference(result) if given["with_reference"] else result.record
