"""Options of the estimation that commands share, and what they become for `modelgen.identify`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import typer

from modelgen.cli.arguments import (
    cutoffs_from,
    delays_from,
    directions_from,
    hold_out_from,
    period_from,
)
from modelgen.cli.data_arguments import DataOptions

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

    def settings(self, method: str, data: DataOptions, **more: Any) -> dict[str, Any]:
        """Return method, filters and checks for `modelgen.identify`.

        Parameters
        ----------
        method : str
        data : DataOptions
            Its directions of motion are settings of the filters, too.
        **more
            Further flat options, see `modelgen.runtime.identification.options.values_of`.
        """
        from modelgen.runtime.identification.options import values_of

        flat = vars(self) | {"held": tuple(self.held or ()), "keep": tuple(self.keep or ())}
        delays, directions = delays_from(flat.pop("delay") or ()), directions_from(data.direction or ())
        return values_of(method, delays=delays, directions=directions, **flat, **more)


def settings_typed(
    estimation: EstimationOptions, given: DataOptions, typed: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the settings of a command that has every option of an identification, from what was typed."""
    pairing = typed["pairing"]
    return estimation.settings(
        typed["method"],
        given,
        cutoff_hz=typed["cutoff_hz"],
        rows_for_tag=None if pairing == "all" else pairing,
        prune_percent=typed["prune_percent"],
        period_s=period_from(typed["period_s"] or (), given.map_file),
        hold_out=hold_out_from(typed["hold_out"] or ()),
        scan_cutoffs=cutoffs_from(typed["scan_cutoffs"]),
    )
