"""Arguments and options that several commands share, each with its one name and one help text."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MEND_HELP = "What to mend: duplicates, gaps, fill, uneven, clocks or offset=KEY; repeatable."

# what a command answers, and what it may do
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs instead of tables.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace output files that exist.")]
Trust = Annotated[
    bool, typer.Option("--trust", help="Execute the module even if modelgen did not write it like this.")
]

# chains and models
Spec = Annotated[str, typer.Argument(metavar="SPEC", help="A chain's TOML file, or a name of the catalogue.")]
SensorSet = Annotated[
    str | None, typer.Option("--sensors", metavar="S", help="One sensor set; all of them if left out.")
]
ParameterSet = Annotated[
    str | None, typer.Option(metavar="SET", help="A parameter set of the spec; the only one if left out.")
]
Module = Annotated[Path, typer.Option("--model", metavar="MODULE.py", help="A generated module.")]

# data files
Data = Annotated[
    list[Path], typer.Argument(metavar="DATA", help="One data file a record: see modelgen import.")
]
Columns = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="KEY=COLUMN", help="Column of a channel; -COLUMN negates; repeatable."),
]
Scales = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY=FACTOR", help="Factor (or scalar of the file) to SI units; repeatable."),
]
MapFile = Annotated[
    Path | None, typer.Option(metavar="MAP.toml", help="What modelgen import wrote; --map goes before it.")
]
SamplingFrequency = Annotated[float | None, typer.Option(metavar="HZ", help="Sampling frequency in Hz.")]
TimeColumn = Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of times.")]
TimeUnit = Annotated[str | None, typer.Option(metavar="UNIT", help="s, ms, us or ns; as stated.")]
Mend = Annotated[list[str] | None, typer.Option(metavar="WHAT", help=MEND_HELP)]

# simulated sensors
Noise = Annotated[
    list[str] | None, typer.Option(metavar="KEY=STD", help="White noise on a channel, SI; repeatable.")
]
Resolution = Annotated[
    list[str] | None, typer.Option(metavar="KEY=STEP", help="Step a channel is rounded to, SI; repeatable.")
]
