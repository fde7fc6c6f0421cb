"""`modelgen run`: a project's records identified as its file says, and kept in its history."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.options import Details, Json, Overwrite, Trust
from modelgen.cli.output import explain_all, note, print_json

ProjectFile = Annotated[
    Path, typer.Argument(metavar="PROJECT.toml", help="What modelgen new --project starts.")
]
LockAgain = Annotated[
    bool, typer.Option("--lock", help="Take records as they are now, although they changed.")
]


def run(
    project: ProjectFile,
    lock: LockAgain = False,
    details: Details = False,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Identify the records of a project file as it says, write its files, and add to its history.

    The same project gives the same bytes. A record that is not what it was when it was read first is an
    error: NAME.project.lock, next to the project, keeps the SHA-256 of each.
    """
    from modelgen.cli.project.run_project import facts_of, run_project
    from modelgen.project.project_file import load_project

    found = load_project(project)
    ran = run_project(found, lock, overwrite, trust)
    note([f"locked {name}" for name in ran.locked])
    for entry, added in ran.entries:
        note([f"{entry.label}: {'added to' if added else 'is in'} {found.history}"])
    note([f"wrote {found.place(name)}" for name in ran.written])
    if as_json:
        print_json(facts_of(found, ran))
    else:
        typer.echo(ran.found.text(details), nl=False)
    for error in ran.failed:
        explain_all(error.problems)
    if ran.failed:
        raise typer.Exit(max(error.exit_code for error in ran.failed))
