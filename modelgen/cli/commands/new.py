"""`modelgen new`: a commented starter spec."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.options import Json, Overwrite
from modelgen.cli.output import report
from modelgen.errors import SpecError


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the chain: letters, digits and _.")],
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write NAME.toml, a commented starter spec."""
    from modelgen.atomic_write import write_whole
    from modelgen.render.environment import environment
    from modelgen.spec.load import parse_spec

    text = environment().get_template("starter.toml.j2").render(name=name)
    # the checks of the spec apply to the name; the comparison detects a name that is parsed as more TOML
    if parse_spec(text, f"{name}.toml").name != name:
        raise SpecError.at("NAME", f"{name!r} is not a name", "use a letter, then letters, digits or _")
    path = Path(f"{name}.toml")
    write_whole(path, text.encode(), overwrite=overwrite)
    report({"written": [str(path)]}, [f"wrote {path}; next: modelgen show {path}"], as_json)
