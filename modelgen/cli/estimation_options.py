"""Options of the estimation that commands share, and what they become for `modelgen.identify`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from modelgen.cli.arguments import cutoffs_from, delays_from, directions_from, hold_out_from, period_from
from modelgen.project.tables import IdentifyTable

MethodName = Literal["auto", "wls", "iv", "tls", "pham2002"]
Method = Annotated[
    MethodName,
    typer.Option(
        help="Instruments, or least squares where the model lacks much (auto); one of them; or the paper."
    ),
]
Tags = Annotated[
    list[str] | None, typer.Option(metavar="RECORD=TAG", help="Tag of a record, for --pairing; repeatable.")
]
Payloads = Annotated[
    list[str] | None,
    typer.Option(
        "--payload",
        metavar="RECORD=NAME|NAME",
        help="What an arm carries in a record, or all; repeatable.",
    ),
]
Pairing = Annotated[
    Literal["all", "pham2002"],
    typer.Option(
        help="Every record feeds every row, or chirps the differentiated rows and trapezoids the rest."
    ),
]
Cutoff = Annotated[float | None, typer.Option(help="Cut-off in Hz of the low-pass; chosen.")]
FilterOrder = Annotated[int | None, typer.Option(help="Order of the low-pass; chosen.")]
Decimation = Annotated[int | None, typer.Option(help="Keep every N-th sample; chosen.")]
DirectionCutoff = Annotated[float | None, typer.Option(help="Cut-off in Hz of directions of motion; chosen.")]
Drop = Annotated[int | None, typer.Option(help="Samples left out at the beginning of a record.")]
Delays = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=SECONDS|estimate|none", help="How late a force is; auto and iv estimate it; repeatable."
    ),
]
Held = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY", help="A force that is a command behind a zero-order hold; repeatable."),
]
PrunePercent = Annotated[
    float, typer.Option(help="Relative std. deviation in % from which parameters are pruned.")
]
ResidualDof = Annotated[
    Literal["r-c", "r-1"], typer.Option(help="Degrees of freedom of the residual in eq. (11).")
]
Keep = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="A parameter not to prune, and not to refuse on doubt; repeatable."),
]
Periods = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SECONDS|RECORD=SECONDS|none", help="Period of the excitation; found in the forces."
    ),
]
HoldOut = Annotated[
    list[str] | None,
    typer.Option(metavar="RECORD|SHARE", help="Records, or the end of all, to test with; repeatable."),
]
ScanCutoffs = Annotated[
    str | None,
    typer.Option(metavar="auto|HZ,HZ,...", help="Estimate behind other filters, too, and compare."),
]
Robust = Annotated[Literal["huber"] | None, typer.Option(help="Samples with large residuals weigh less.")]
Rows = Annotated[
    Literal["force", "power"],
    typer.Option(help="Balances of force, or one of power: no accelerations, for wls."),
]
MemoryLimit = Annotated[
    float | None, typer.Option(help="MB that filtered rows may take; more are made again. No limit.")
]
Bounds = Annotated[
    Literal["physical"] | None,
    typer.Option(help="No negative inertia, stiffness, damping, friction; links of arms are bodies."),
]


@dataclass(frozen=True)
class EstimationOptions:
    """What an identification is made with, whichever command asks for it.

    Method, cut-off and checks are options of each command, since their defaults differ.
    """

    filter_order: FilterOrder = None
    decimation: Decimation = None
    direction_cutoff_hz: DirectionCutoff = None
    drop: Drop = None
    delay: Delays = None
    held: Held = None
    residual_dof: ResidualDof = "r-c"
    keep: Keep = None
    robust: Robust = None
    bounds: Bounds = None
    rows: Rows = "force"
    memory_limit_mb: MemoryLimit = None


@dataclass(frozen=True)
class FullOptions:
    """What commands offer besides `EstimationOptions` that have every option of an identification."""

    method: Method = "auto"
    cutoff_hz: Cutoff = None
    pairing: Pairing = "all"
    prune_percent: PrunePercent = 10.0
    period_s: Periods = None
    hold_out: HoldOut = None
    scan_cutoffs: ScanCutoffs = None


# options whose text is read into a value
_READ: Mapping[str, Any] = {
    "delay": delays_from,
    "period_s": period_from,
    "hold_out": hold_out_from,
    "scan_cutoffs": cutoffs_from,
    "held": tuple,
    "keep": tuple,
}


def identify_table(typed: Mapping[str, Any]) -> IdentifyTable:
    """Return options of an estimation, from all that were typed, as the table of a project file."""
    given = {one.name: typed[one.name] for one in fields(IdentifyTable) if typed.get(one.name) is not None}
    read: dict[str, Any] = {
        name: _READ[name](value) if name in _READ else value for name, value in given.items()
    }
    return IdentifyTable(**read)


def settings_of(table: IdentifyTable, directions: Mapping[str, str], map_file: Path | None) -> dict[str, Any]:
    """Return method, filters and checks for `modelgen.identify`.

    Parameters
    ----------
    table : IdentifyTable
    directions : mapping of str to str
        Directions of motion are settings of the filters, too.
    map_file : Path, optional
        Declares the period of the excitation where the table does not.
    """
    from modelgen.runtime.identification.options import values_of

    flat = dict(vars(table))
    if table.period_s is None and map_file is not None:
        flat["period_s"] = period_from((), map_file)
    pairing = flat.pop("pairing")
    paired = None if pairing == "all" else pairing
    delays = flat.pop("delay")
    return values_of(delays=delays, directions=dict(directions), rows_for_tag=paired, **flat)


def settings_typed(typed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings for `modelgen.identify` from what was typed."""
    return settings_of(identify_table(typed), directions_from(typed["direction"] or ()), typed["map_file"])
