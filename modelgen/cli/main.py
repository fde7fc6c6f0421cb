"""The command line: the only place where the derivation and the estimation meet.

Every command imports what it needs when it runs, so that `modelgen --help` needs no NumPy.
Exit codes: 0 done, 1 the data cannot answer (or a check failed), 2 wrong input.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from modelgen.cli.arguments import (
    Trust,
    amounts,
    compared_sensor_sets,
    cutoffs_from,
    delays_from,
    excitation_from,
    given_options,
    hold_out_from,
    load_chain,
    parameter_values,
    period_from,
    proof_of,
    sensor_sets,
)
from modelgen.cli.command_group import CheckedCommand, ExplainedGroup
from modelgen.cli.compare import compare
from modelgen.cli.data_arguments import (
    BESIDE_REFERENCE,
    MEND_HELP,
    REFERENCE,
    DataOptions,
    direction_sources,
    read_files,
    reading_lines,
)
from modelgen.cli.design import design
from modelgen.cli.examples import examples_of
from modelgen.cli.fleet import fleet
from modelgen.cli.output import note, print_json, report, say
from modelgen.cli.validate import validate
from modelgen.errors import SpecError
from modelgen.progress import counted

app = typer.Typer(
    cls=ExplainedGroup,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Identification models of spring-coupled chains: derive, generate, simulate, identify.",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs instead of tables.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")]
Spec = Annotated[str, typer.Argument(metavar="SPEC", help="A chain's TOML file, or a name of the catalogue.")]
SensorSet = Annotated[
    str | None, typer.Option("--sensors", metavar="S", help="One sensor set; all of them if left out.")
]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on the given arguments (those of the process if None) and exit."""
    app(args=arguments, prog_name="modelgen")


@app.command(cls=CheckedCommand, epilog=examples_of("demo"))
def demo(as_json: Json = False) -> None:
    """Show the paper end to end: derive, simulate, identify.

    Modules, two records and a picture go to the folder modelgen_demo.
    """
    from modelgen.cli.demo import run_demo
    from modelgen.cli.tables import console, demo_tables

    found = run_demo(Path("modelgen_demo"), say)
    if as_json:
        print_json(found)
    else:
        console().print(demo_tables(found))


@app.command(cls=CheckedCommand, epilog=examples_of("new"))
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the chain: letters, digits and _.")],
    as_json: Json = False,
) -> None:
    """Write NAME.toml, a commented starter spec."""
    from modelgen.atomic_write import write_whole
    from modelgen.render.environment import environment
    from modelgen.spec.load import parse_spec

    text = environment().get_template("starter.toml.j2").render(name=name)
    # the spec's own checks say what a name may be; the comparison keeps a name from being read as more TOML
    if parse_spec(text, f"{name}.toml").name != name:
        raise SpecError.at("NAME", f"{name!r} is not a name", "use a letter, then letters, digits or _")
    path = Path(f"{name}.toml")
    write_whole(path, text.encode(), overwrite=False)
    report({"written": [str(path)]}, [f"wrote {path}; next: modelgen show {path}"], as_json)


@app.command(cls=CheckedCommand, epilog=examples_of("show"))
def show(
    spec: Spec,
    sensors: Annotated[
        str | None,
        typer.Option(
            metavar="S",
            help='One sensor set in detail; "all": every subset of position and acceleration sensors.',
        ),
    ] = None,
    prove: Annotated[
        bool, typer.Option("--prove", help="Prove that Newton-Euler and Lagrange give the same equations.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Show a chain's equations and its sensor sets side by side, or one of them in detail.

    The table says for every set its rows, the highest derivative they need, which parameters can be
    identified, and which are lost against a position sensor on every body.
    """
    from modelgen.cli.tables import chain_tables, console, describe_chain
    from modelgen.symbolic.equations.newton import motion_equations

    chain = load_chain(spec)
    motion = motion_equations(chain)
    found = compared_sensor_sets(chain, sensors)
    described = describe_chain(motion, found, proof_of(motion) if prove else None)
    if as_json:
        print_json(described)
    else:
        console().print(chain_tables(described))


@app.command(cls=CheckedCommand, epilog=examples_of("generate"))
def generate(
    specs: Annotated[list[str], typer.Argument(metavar="SPEC", help="TOML files or names of the catalogue.")],
    sensors: SensorSet = None,
    folder: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the modules.")
    ] = Path("generated"),
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit 1 if a module is not up to date.")
    ] = False,
    target: Annotated[
        Literal["numpy", "matlab", "c"], typer.Option(help="NumPy module, MATLAB/Octave class, or C99 files.")
    ] = "numpy",
    templates: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Templates (*.j2) of your own in place of a target; sandboxed."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Generate one module for each sensor set of each SPEC.

    With --check nothing is written: what is missing, different or left over is named, with exit code 1.
    """
    from modelgen.render.target_writer import check_target, write_target

    chains = [(chain, sensor_sets(chain, sensors)) for chain in map(load_chain, specs)]
    if not check:
        counting = counted(chains, "generating")
        made = (write_target(chain, names, folder, target, templates) for chain, names in counting)
        paths = [str(path) for written in made for path in written]
        report({"target": target, "written": paths}, [f"wrote {path}" for path in paths], as_json)
        return
    checked = (check_target(chain, names, folder, target, templates) for chain, names in chains)
    drifts = [drift for found in checked for drift in found]
    lines = [f"{drift.path}: {drift.state}" for drift in drifts]
    summary = (
        f"{len(drifts)} modules are not what their specs generate" if drifts else "all modules are up to date"
    )
    found = [{"path": str(drift.path), "state": drift.state} for drift in drifts]
    report({"target": target, "drift": found}, [*lines, summary], as_json)
    if drifts:
        raise typer.Exit(1)


@app.command("import", cls=CheckedCommand, epilog=examples_of("import"))
def import_(
    data: Annotated[Path, typer.Argument(metavar="FILE", help="A data file of any format modelgen reads.")],
    module: Annotated[
        Path | None, typer.Option("--model", metavar="MODULE.py", help="The model whose channels to find.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="MAP.toml", help="FILE.map.toml if left out.")
    ] = None,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Show a data file's channels, propose which is which, and write that as TOML for identify --map-file.

    Nothing is mended: what is uneven, missing, doubled or offset is listed with its size.
    """
    from modelgen.atomic_write import write_whole
    from modelgen.cli.import_file import describe_file, import_lines
    from modelgen.runtime.model.model import load_model

    described = describe_file(data, load_model(module, trust) if module else None)
    path = output or data.with_name(f"{data.stem}.map.toml")
    write_whole(path, described["mapping"].encode(), overwrite=overwrite)
    described["written"] = [str(path)]
    report(described, import_lines(described, path, module), as_json)


@app.command(cls=CheckedCommand, epilog=examples_of("identify"))
def identify(
    context: typer.Context,
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA", help="One data file a record: see modelgen import.")
    ],
    module: Annotated[Path, typer.Option("--model", metavar="MODULE.py", help="A generated module.")],
    method: Annotated[
        Literal["wls", "iv", "tls", "pham2002"],
        typer.Option(
            help="Matched filters, on them instrumental variables or total least squares; or the paper."
        ),
    ] = "wls",
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="KEY=COLUMN", help="Column of a channel; -COLUMN negates; repeatable."),
    ] = None,
    scale: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=FACTOR", help="Factor (or scalar of the file) to SI units; repeatable."),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option(metavar="MAP.toml", help="What modelgen import wrote; --map goes before it."),
    ] = None,
    fs: Annotated[float | None, typer.Option(metavar="HZ", help="Sampling frequency in Hz.")] = None,
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of times.")] = None,
    time_unit: Annotated[str | None, typer.Option(metavar="UNIT", help="s, ms, us or ns; as stated.")] = None,
    mend: Annotated[list[str] | None, typer.Option(metavar="WHAT", help=MEND_HELP)] = None,
    direction: Annotated[
        list[str] | None,
        typer.Option(metavar="sign_BODY=CHANNEL", help="A channel that moves with a body; repeatable."),
    ] = None,
    tag: Annotated[
        list[str] | None,
        typer.Option(metavar="RECORD=TAG", help="Tag of a record, for --pairing; repeatable."),
    ] = None,
    pairing: Annotated[
        Literal["all", "pham2002"],
        typer.Option(
            help="Every record feeds every row, or chirps the differentiated rows and trapezoids the rest."
        ),
    ] = "all",
    cutoff_hz: Annotated[float | None, typer.Option(help="Cut-off in Hz of the low-pass; chosen.")] = None,
    filter_order: Annotated[int | None, typer.Option(help="Order of the low-pass; chosen.")] = None,
    decimation: Annotated[int | None, typer.Option(help="Keep every N-th sample; chosen.")] = None,
    direction_cutoff_hz: Annotated[
        float | None, typer.Option(help="Cut-off in Hz of directions of motion; chosen.")
    ] = None,
    drop: Annotated[int | None, typer.Option(help="Samples left out at the beginning of a record.")] = None,
    delay: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=SECONDS|estimate|none", help="How late a force is; iv estimates it; repeatable."
        ),
    ] = None,
    held: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY", help="A force that is a command behind a zero-order hold; repeatable."),
    ] = None,
    prune_percent: Annotated[
        float, typer.Option(help="Relative std. deviation in % from which parameters are pruned.")
    ] = 10.0,
    residual_dof: Annotated[
        Literal["r-c", "r-1"], typer.Option(help="Degrees of freedom of the residual in eq. (11).")
    ] = "r-c",
    keep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A parameter not to prune, and not to refuse on doubt; repeatable."
        ),
    ] = None,
    period_s: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SECONDS|RECORD=SECONDS|none", help="Period of the excitation; found in the forces."
        ),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(metavar="RECORD|SHARE", help="Records, or the end of all, to test with; repeatable."),
    ] = None,
    scan_cutoffs: Annotated[
        str | None,
        typer.Option(metavar="auto|HZ,HZ,...", help="Estimate behind other filters, too, and compare."),
    ] = None,
    robust: Annotated[
        Literal["huber"] | None, typer.Option(help="Samples with large residuals weigh less.")
    ] = None,
    bounds: Annotated[
        Literal["physical"] | None, typer.Option(help="No negative inertia, stiffness, damping, friction.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.json", help="Save the estimate.")
    ] = None,
    report_file: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.html", help="Write everything as one HTML page.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw measured and rebuilt forces: png, svg, pdf.")
    ] = None,
    spec: Annotated[
        str | None, typer.Option(metavar="SPEC", help="The chain, for the report's table of sensor sets.")
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="The loop, for the report's overlay; needs column reference."),
    ] = None,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Identify a generated module's parameters from measured records.

    What is "chosen" is chosen from the records and explained in the output, unless it is given.
    """
    from modelgen.atomic_write import write_whole
    from modelgen.cli.write_report import FIGURES, REPORTS, check_output, write_figure, write_report
    from modelgen.runtime.identification.identify import identify as run
    from modelgen.runtime.model.model import load_model

    model = load_model(module, trust)
    options = DataOptions(
        mapping or (), scale or (), fs, time, time_unit, map_file, mend or (), direction or (), tag or ()
    )
    # what would go wrong at the end is said at the beginning
    for path, suffixes in ((output, ()), (report_file, REPORTS), (figure, FIGURES)):
        if path is not None:
            check_output(path, suffixes, overwrite)
    told = (REFERENCE, BESIDE_REFERENCE) if controller and report_file else ()
    readings = read_files(data, model, options, *told)
    estimate = run(
        model,
        [reading.record for reading in readings],
        method=method,
        cutoff_hz=cutoff_hz,
        filter_order=filter_order,
        decimation=decimation,
        direction_cutoff_hz=direction_cutoff_hz,
        drop=drop,
        prune_percent=prune_percent,
        residual_dof=residual_dof,
        directions=direction_sources(options),
        delays=delays_from(delay or ()),
        held=held or (),
        rows_for_tag=None if pairing == "all" else pairing,
        keep=keep or (),
        period_s=period_from(period_s or (), map_file),
        hold_out=hold_out_from(hold_out or ()),
        scan_cutoffs=cutoffs_from(scan_cutoffs),
        robust=robust,
        bounds=bounds,
        progress=say,
    )
    if output is not None:
        write_whole(output, estimate.to_json().encode(), overwrite=overwrite)
    if report_file is not None:
        say("writing the report")
        write_report(
            report_file,
            model,
            module,
            readings,
            estimate,
            given_options(context),
            spec,
            controller,
            overwrite,
        )
    if figure is not None:
        write_figure(figure, model, readings, estimate, overwrite)
    note(reading_lines(data, readings))
    note([f"wrote {path}" for path in (output, report_file, figure) if path is not None])
    if as_json:
        print_json(estimate.to_dict())
    else:
        typer.echo(estimate.summary(), nl=False)


@app.command(cls=CheckedCommand, epilog=examples_of("simulate"))
def simulate(
    spec: Spec,
    sensors: Annotated[str, typer.Option("--sensors", metavar="S", help="The sensor set that records.")],
    excitation: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="chirp, trapezoid, or a data file with columns reference, reference_rate or feedforward, "
            "and the forces of actuators behind the first.",
        ),
    ],
    data: Annotated[
        Path, typer.Option("-o", "--output", metavar="DATA", help="A .csv or .npz file to write.")
    ],
    parameters: Annotated[
        str | None, typer.Option(metavar="SET", help="A parameter set of the spec; the only one if left out.")
    ] = None,
    fs_hz: Annotated[
        float | None, typer.Option(help="Sampling frequency in Hz; 5000, or that of the excitation's file.")
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option(help="Duration in s of chirp or trapezoid; 2 s.")
    ] = None,
    noise: Annotated[
        list[str] | None, typer.Option(metavar="KEY=STD", help="White noise on a channel, SI; repeatable.")
    ] = None,
    resolution: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=STEP", help="Step a channel is rounded to, SI; repeatable."),
    ] = None,
    bias: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=ERROR", help="Constant error of a channel, SI; repeatable."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    controller: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="The loop; one slow against the lowest mode.")
    ] = None,
    with_reference: Annotated[
        bool, typer.Option("--with-reference", help="Also write what the loop was told, for validate.")
    ] = False,
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


app.command(cls=CheckedCommand, epilog=examples_of("validate"))(validate)
app.command(cls=CheckedCommand, epilog=examples_of("compare"))(compare)
app.command(cls=CheckedCommand, epilog=examples_of("fleet"))(fleet)
app.command(cls=CheckedCommand, epilog=examples_of("design"))(design)
