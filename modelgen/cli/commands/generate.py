"""`modelgen generate`: one module for each sensor set of each spec."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from modelgen.cli.arguments import load_chain_or_arm, modules_of
from modelgen.cli.options import Json, SensorSet
from modelgen.cli.output import report
from modelgen.progress import counted


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
    """Generate one module for each sensor set of each SPEC; of an arm one module.

    Modules that modelgen wrote before are replaced; a file of another origin is left, with a message.
    With --check nothing is written: what is missing, different or left over is named, with exit code 1.
    """
    from modelgen.render.target_writer import check_target, refuse_shared_files, write_target

    chains = [(spec, modules_of(spec, sensors)) for spec in map(load_chain_or_arm, specs)]
    refuse_shared_files(chains)
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
