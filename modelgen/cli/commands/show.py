"""`modelgen show`: equations and sensor sets of a chain."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.atomic_write import write_whole
from modelgen.cli.arguments import compared_sensor_sets, load_chain, proof_of
from modelgen.cli.options import Json, Overwrite, Spec
from modelgen.cli.output import note, print_json
from modelgen.cli.output_files import check_output


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
    svg: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE.svg", help="Write a picture of the chain.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Show a chain's equations and its sensor sets side by side, or one of them in detail.

    The table says for every set its rows, the highest derivative they need, which parameters can be
    identified, and which are lost against a position sensor on every body.
    """
    from modelgen.cli.tables import chain_tables, console, describe_chain
    from modelgen.report.chain_drawing import draw_chain
    from modelgen.symbolic.equations.newton import motion_equations

    chain = load_chain(spec)
    if svg:
        check_output(svg, (".svg",), overwrite)
    motion = motion_equations(chain)
    found = compared_sensor_sets(chain, sensors)
    described = describe_chain(motion, found, proof_of(motion) if prove else None)
    if svg:
        picture = draw_chain(chain, sensors if sensors in chain.sensor_sets else None)
        write_whole(svg, picture.encode(), overwrite=overwrite)
        described["written"] = [str(svg)]
        note([f"wrote {svg}"])
    if as_json:
        print_json(described)
    else:
        console().print(chain_tables(described))
