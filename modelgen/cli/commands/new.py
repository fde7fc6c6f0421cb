"""`modelgen new`: a commented starter spec, or a project file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.options import Json, Overwrite
from modelgen.cli.output import report
from modelgen.errors import SpecError

WithProject = Annotated[
    bool,
    typer.Option("--project", help="Write NAME.project.toml for modelgen run; NAME.toml if there is none."),
]


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the chain: letters, digits and _.")],
    project: WithProject = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write NAME.toml, a commented starter spec; or a project file for a chain."""
    from modelgen.atomic_write import write_whole
    from modelgen.render.environment import environment
    from modelgen.spec.load import load_spec, parse_spec

    text = environment().get_template("starter.toml.j2").render(name=name)
    # the checks of the spec apply to the name; the comparison detects a name that is parsed as more TOML
    if parse_spec(text, f"{name}.toml").name != name:
        raise SpecError.at("NAME", f"{name!r} is not a name", "use a letter, then letters, digits or _")
    path = Path(f"{name}.toml")
    texts = {path: text}
    if project:
        from modelgen.cli.project.starter import starter_project

        chain = load_spec(path) if path.exists() else parse_spec(text, path.name)
        texts = {} if path.exists() else texts
        texts[Path(f"{name}.project.toml")] = starter_project(name, chain)
    for place, content in texts.items():
        write_whole(place, content.encode(), overwrite=overwrite)
    follows = f"modelgen run {name}.project.toml" if project else f"modelgen show {path}"
    lines = [f"wrote {place}" for place in texts]
    lines[-1] += f"; next: {follows}"
    report({"written": [str(place) for place in texts]}, lines, as_json)
