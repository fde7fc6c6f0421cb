"""Options of `modelgen design` that are of arms only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

_BOX = "FRAME=X0:X1,Y0:Y1,Z0:Z1"
Inside = Annotated[
    list[str] | None,
    typer.Option(
        metavar=_BOX, help="Of an arm: box (m, of the base) that a joint's frame stays in; repeatable."
    ),
]
Outside = Annotated[
    list[str] | None, typer.Option(metavar=_BOX, help="Of an arm: box that a frame keeps out of; repeatable.")
]
Harmonics = Annotated[int, typer.Option(min=2, max=50, help="Of an arm: harmonics of the Fourier series.")]
Seeds = Annotated[int, typer.Option(min=1, help="Of an arm: searches from different beginnings.")]


@dataclass(frozen=True)
class TrajectoryFlags:
    """What a trajectory keeps to, and how it is searched for."""

    inside: Inside = None
    outside: Outside = None
    harmonics: Harmonics = 5
    seeds: Seeds = 8
