"""`modelgen new`: a commented starter spec of a chain or an arm, or a project file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from modelgen.cli.options import Json, Overwrite
from modelgen.cli.output import report
from modelgen.errors import SpecError

WithProject = Annotated[
    bool,
    typer.Option("--project", help="Write NAME.project.toml for modelgen run; NAME.toml if there is none."),
]
OfArm = Annotated[bool, typer.Option("--arm", help="Start an arm of links and joints in place of a chain.")]
OfSprings = Annotated[
    bool, typer.Option("--elastic", help="Start an arm with springs in its joints, and sensors.")
]
FromUrdf = Annotated[
    Path | None, typer.Option("--urdf", metavar="FILE.urdf", help="Start an arm from a URDF; it stays there.")
]


def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the chain or arm: letters, digits and _.")
    ],
    arm: OfArm = False,
    elastic: OfSprings = False,
    urdf: FromUrdf = None,
    project: WithProject = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write NAME.toml, a commented starter spec of a chain or an arm; or a project file for a chain."""
    from modelgen.atomic_write import write_whole

    if project and (arm or urdf or elastic):
        raise SpecError.at(
            "--project", "is for chains", "leave it out, or leave out --arm, --elastic and --urdf"
        )
    path = Path(f"{name}.toml")
    text = _arm_text(name, urdf, elastic) if arm or urdf or elastic else _chain_text(name)
    texts = {path: text}
    if project:
        from modelgen.cli.project.starter import starter_project
        from modelgen.spec.load import load_spec, parse_spec

        chain = load_spec(path) if path.exists() else parse_spec(text, path.name)
        texts = {} if path.exists() else texts
        texts[Path(f"{name}.project.toml")] = starter_project(name, chain)
    for place, content in texts.items():
        write_whole(place, content.encode(), overwrite=overwrite)
    follows = f"modelgen run {name}.project.toml" if project else f"modelgen show {path}"
    lines = [f"wrote {place}" for place in texts]
    lines[-1] += f"; next: {follows}"
    report({"written": [str(place) for place in texts]}, lines, as_json)


def _chain_text(name: str) -> str:
    from modelgen.render.environment import environment
    from modelgen.spec.load import parse_spec

    text = environment().get_template("starter.toml.j2").render(name=name)
    # the checks of the spec apply to the name; the comparison detects a name that is parsed as more TOML
    if parse_spec(text, f"{name}.toml").name != name:
        raise _no_name(name)
    return text


def _arm_text(name: str, urdf: Path | None, elastic: bool) -> str:
    from modelgen.documents import toml_string
    from modelgen.read_file import URDF, read_text
    from modelgen.render.environment import environment
    from modelgen.spec.arms.load import parse_arm
    from modelgen.spec.arms.urdf.read_urdf import without_coordinate
    from modelgen.spec.words import identifier_problem

    if identifier_problem(name):
        raise _no_name(name)
    names: dict[str, Any] = {"urdf": None, "joints": ["1", "2", "3"], "held": []}
    if urdf is not None:
        quoted = toml_string(str(urdf))
        held = without_coordinate(read_text(urdf, URDF), urdf.name)
        bare = f'[arm]\nname = "{name}"\nurdf = {quoted}\n'
        bare += "".join(f'[[joints]]\nname = "{joint}"\ntype = "fixed"\n' for joint in held)
        moving = [joint.name for joint in parse_arm(bare, f"{name}.toml", Path()).moving]
        names = {"urdf": quoted, "joints": moving, "held": held}
    text = environment().get_template("starter_arm.toml.j2").render(name=name, elastic=elastic, **names)
    parse_arm(text, f"{name}.toml", Path())
    return text


def _no_name(name: str) -> SpecError:
    return SpecError.at("NAME", f"{name!r} is not a name", "use a letter, then letters, digits or _")
