"""`modelgen show`: equations and sensor sets of a chain; joints, drives and parameters of an arm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.atomic_write import write_whole
from modelgen.cli.arguments import compared_sensor_sets, load_chain_or_arm, modules_of, proof_of
from modelgen.cli.options import Json, Overwrite, SpecOfAny
from modelgen.cli.output import note, print_json
from modelgen.cli.output_files import check_output

if TYPE_CHECKING:
    from modelgen.spec.arms.arm import ArmSpec
    from modelgen.spec.chain import ChainSpec


def show(
    spec: SpecOfAny,
    sensors: Annotated[
        str | None,
        typer.Option(
            metavar="S",
            help='One sensor set in detail; "all": every subset of sensors, of an arm the usual sets.',
        ),
    ] = None,
    prove: Annotated[
        bool, typer.Option("--prove", help="Prove that Newton-Euler and Lagrange give the same equations.")
    ] = False,
    svg: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE.svg", help="Write a picture of the chain or arm.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Show a chain's equations and its sensor sets side by side, or one of them in detail; or an arm.

    The table says for every set its rows, the highest derivative they need, which parameters can be
    identified, and which are lost against a position sensor on every body. Of an arm it shows joints, limits,
    gears, parameters, which sums of them its motion distinguishes, and what its sensor sets give.
    """
    from modelgen.cli.tables import console
    from modelgen.spec.arms.arm import ArmSpec

    found = load_chain_or_arm(spec)
    if svg:
        check_output(svg, (".svg",), overwrite)
    if isinstance(found, ArmSpec):
        described, picture, layout = _arm(found, sensors, prove, svg is not None)
    else:
        described, picture, layout = _chain(found, sensors, prove, svg is not None)
    if svg:
        write_whole(svg, picture.encode(), overwrite=overwrite)
        described["written"] = [str(svg)]
        note([f"wrote {svg}"])
    if as_json:
        print_json(described)
    else:
        console().print(layout(described))


def _chain(
    chain: ChainSpec, sensors: str | None, prove: bool, drawn: bool
) -> tuple[dict[str, Any], str, Any]:
    from modelgen.cli.tables import chain_tables, describe_chain
    from modelgen.report.chain_drawing import draw_chain
    from modelgen.symbolic.equations.newton import motion_equations

    motion = motion_equations(chain)
    found = compared_sensor_sets(chain, sensors)
    described = describe_chain(motion, found, proof_of(motion) if prove else None)
    picture = draw_chain(chain, sensors if sensors in chain.sensor_sets else None) if drawn else ""
    return described, picture, chain_tables


def _arm(arm: ArmSpec, sensors: str | None, prove: bool, drawn: bool) -> tuple[dict[str, Any], str, Any]:
    from modelgen.cli.arms.arm_tables import arm_tables, describe_arm
    from modelgen.report.arm_drawing import draw_arm

    if sensors != "all":
        modules_of(arm, sensors)  # refuses what is no sensor set
    return describe_arm(arm, prove, sensors), draw_arm(arm) if drawn else "", arm_tables
