"""`modelgen show`: equations and sensor sets of a chain."""

from __future__ import annotations

from typing import Annotated

import typer

from modelgen.cli.arguments import compared_sensor_sets, load_chain, proof_of
from modelgen.cli.options import Json, Spec
from modelgen.cli.output import print_json


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
