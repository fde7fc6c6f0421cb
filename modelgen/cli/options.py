"""Arguments and options that several commands share, each with its one name and one help text.

A command takes many of them as one parameter, a dataclass whose fields are the options.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from modelgen.errors import DataError

MEND_HELP = (
    "What to mend: duplicates, gaps, fill, uneven, clocks, unwrap=KEY, repeats=KEY, offset=KEY; repeatable."
)

# what a command answers, and what it may do
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs instead of tables.")]
Details = Annotated[
    bool,
    typer.Option("--details", help="Print everything: filters, tests, every warning.", show_default=False),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace output files that exist.")]
Trust = Annotated[
    bool, typer.Option("--trust", help="Execute the module even if modelgen did not write it like this.")
]

# chains and models
SpecOfAny = Annotated[
    str, typer.Argument(metavar="SPEC", help="TOML file of a chain or an arm, or a name of the catalogue.")
]
SensorSet = Annotated[
    str | None, typer.Option("--sensors", metavar="S", help="One sensor set; all of them if left out.")
]
ParameterSet = Annotated[
    str | None, typer.Option(metavar="SET", help="A parameter set of the spec; the only one if left out.")
]
Module = Annotated[Path, typer.Option("--model", metavar="MODULE.py", help="A generated module.")]
Values = Annotated[
    list[str] | None,
    typer.Option(
        "--set", "--known", metavar="NAME=VALUE", help="A parameter's value, SI, not estimated; repeatable."
    ),
]

# data files
Data = Annotated[
    list[Path],
    typer.Argument(
        metavar="DATA",
        help="One data file a record, or several with commas between them: see modelgen import.",
    ),
]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="KEY=COLUMN",
        help="Column of a channel; -COLUMN negates; of a matrix y[:,0] as in Python or y(:,1) as in MATLAB; "
        "repeatable.",
    ),
]
Scales = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY=FACTOR", help="Factor (or scalar of the file) to SI units; repeatable."),
]
MapFile = Annotated[
    Path | None, typer.Option(metavar="MAP.toml", help="What modelgen import wrote; --map goes before it.")
]
SamplingFrequency = Annotated[
    float | None, typer.Option("--fs", "--fs-hz", metavar="HZ", help="Sampling frequency in Hz.")
]
TimeColumn = Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of times.")]
TimeUnit = Annotated[str | None, typer.Option(metavar="UNIT", help="s, ms, us, ns or days; as stated.")]
Mend = Annotated[list[str] | None, typer.Option(metavar="WHAT", help=MEND_HELP)]

Directions = Annotated[
    list[str] | None,
    typer.Option(metavar="sign_BODY=CHANNEL", help="A channel that moves with a body; repeatable."),
]

# simulated sensors
Noise = Annotated[
    list[str] | None, typer.Option(metavar="KEY=STD", help="White noise on a channel, SI; repeatable.")
]
Resolution = Annotated[
    list[str] | None, typer.Option(metavar="KEY=STEP", help="Step a channel is rounded to, SI; repeatable.")
]


@dataclass(frozen=True)
class ResultOptions:
    """What a command does with its answer: print it as tables or as JSON, and save it."""

    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.json", help="Save what --json prints.")
    ] = None
    overwrite: Overwrite = False
    as_json: Json = False


def expanded(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer can read it: every parameter that is a group of options becomes its fields.

    A group is a dataclass with a default for every field. The command is called with the group, made of what
    was given.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind) and isinstance(kind, type)}

    def run(**given: Any) -> None:
        for name, kind in groups.items():
            given[name] = kind(**{one.name: given.pop(one.name) for one in fields(kind)})
        command(**given)

    listed: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        if name not in groups:
            listed.append(parameter.replace(annotation=hints[name], kind=Parameter.KEYWORD_ONLY))
            continue
        options = get_type_hints(groups[name], include_extras=True)
        listed += [
            Parameter(one.name, Parameter.KEYWORD_ONLY, default=one.default, annotation=options[one.name])
            for one in fields(groups[name])
        ]
    run.__doc__, run.__name__, run.__module__ = command.__doc__, command.__name__, command.__module__
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in listed}
    run.__signature__ = signature(command).replace(parameters=listed)  # type: ignore[attr-defined]
    return run


def refuse_given(group: Any, needed: str, more: Sequence[Any] = ()) -> None:
    """Refuse options, those of a group and `more` values, that do nothing without another one.

    Raises
    ------
    DataError
        When one of them was given.
    """
    changed = [getattr(group, one.name) for one in fields(group) if getattr(group, one.name) != one.default]
    if any(changed) or any(more):
        what = "is missing: without it nothing is identified, and options of records or estimation do nothing"
        raise DataError.at(needed, what, f"give {needed}, or leave them out")
