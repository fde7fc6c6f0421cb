"""The command line: the only place where the derivation and the estimation meet.

Every command imports what it needs when it runs, so that `modelgen --help` needs no NumPy.
Exit codes: 0 done, 1 the data do not determine the result (or a check failed), 2 wrong input.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from modelgen.cli.command_group import CheckedCommand, ExplainedGroup
from modelgen.cli.examples import PURPOSES, examples_of
from modelgen.cli.options import expanded

# name on the command line -> module and function, in the order of the help
COMMANDS = {
    name: "import_file" if name == "import" else name for names in PURPOSES.values() for name in names
}


def application(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """Return the command line with the named commands."""
    app = typer.Typer(
        cls=ExplainedGroup,
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        callback=_group,
        help="Identification models of spring-coupled chains: derive, generate, simulate, identify.",
    )
    for name in names:
        command = getattr(import_module(f"modelgen.cli.commands.{COMMANDS[name]}"), COMMANDS[name])
        app.command(name, cls=CheckedCommand, epilog=examples_of(name))(expanded(command))
    return app


def _show_version(asked: bool) -> None:
    if asked:
        import modelgen

        typer.echo(f"modelgen {modelgen.__version__}")
        raise typer.Exit


def _group(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    """Keep a single command a member of a group: `modelgen identify`, not `modelgen`."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on the given arguments (those of the process if None) and exit."""
    given = sys.argv[1:] if arguments is None else arguments
    # the options of eleven commands take longer to build than those of the one that is called
    names = given[:1] if given and given[0] in COMMANDS else COMMANDS
    application(names)(args=arguments, prog_name="modelgen")


def __getattr__(name: str) -> Any:
    """Build `app`, the command line with all commands, when it is first used (PEP 562)."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()["app"] = application()
    return globals()["app"]
