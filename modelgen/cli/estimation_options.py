"""Options of the estimation that identify and fleet share, and what they become for `modelgen.identify`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import typer

from modelgen.cli.arguments import cutoffs_from, delays_from, directions_from, hold_out_from, period_from

Method = Annotated[
    Literal["wls", "iv", "tls", "pham2002"],
    typer.Option(
        help="Matched filters, on them instrumental variables or total least squares; or the paper."
    ),
]
Directions = Annotated[
    list[str] | None,
    typer.Option(metavar="sign_BODY=CHANNEL", help="A channel that moves with a body; repeatable."),
]
Tags = Annotated[
    list[str] | None, typer.Option(metavar="RECORD=TAG", help="Tag of a record, for --pairing; repeatable.")
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
        metavar="KEY=SECONDS|estimate|none", help="How late a force is; iv estimates it; repeatable."
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
Bounds = Annotated[
    Literal["physical"] | None, typer.Option(help="No negative inertia, stiffness, damping, friction.")
]
# options that go on to the estimation as they are
PASSED_ON = (
    "method",
    "cutoff_hz",
    "filter_order",
    "decimation",
    "direction_cutoff_hz",
    "drop",
    "prune_percent",
    "residual_dof",
    "robust",
    "bounds",
)


def estimation_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return method, filters and checks for `modelgen.identify` from the options of a command."""
    from modelgen.runtime.identification.options import values_of

    flat = {name: given[name] for name in PASSED_ON} | {
        "delays": delays_from(given["delay"] or ()),
        "held": tuple(given["held"] or ()),
        "rows_for_tag": None if given.get("pairing", "all") == "all" else given["pairing"],
        "keep": tuple(given["keep"] or ()),
        "period_s": period_from(given["period_s"] or (), given["map_file"]),
        "hold_out": hold_out_from(given.get("hold_out") or ()),
        "scan_cutoffs": cutoffs_from(given.get("scan_cutoffs")),
        "directions": directions_from(given["direction"] or ()),
    }
    return values_of(**flat)
