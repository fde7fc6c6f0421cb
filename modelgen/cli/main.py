"""The command line: the only place where the derivation and the estimation meet.

Every command imports what it needs when it runs, so that `modelgen --help` needs no NumPy.
Exit codes: 0 done, 1 the data cannot answer (or a check failed), 2 wrong input.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import typer

from modelgen.cli.command_group import CheckedCommand, ExplainedGroup
from modelgen.cli.commands.compare import compare
from modelgen.cli.commands.demo import demo
from modelgen.cli.commands.design import design
from modelgen.cli.commands.generate import generate
from modelgen.cli.commands.identify import identify
from modelgen.cli.commands.import_file import import_file
from modelgen.cli.commands.new import new
from modelgen.cli.commands.show import show
from modelgen.cli.commands.simulate import simulate
from modelgen.cli.commands.validate import validate
from modelgen.cli.examples import examples_of
from modelgen.cli.fleet import fleet

COMMANDS: dict[str, Callable[..., None]] = {
    "demo": demo,
    "new": new,
    "show": show,
    "generate": generate,
    "import": import_file,
    "identify": identify,
    "simulate": simulate,
    "validate": validate,
    "compare": compare,
    "fleet": fleet,
    "design": design,
}

app = typer.Typer(
    cls=ExplainedGroup,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Identification models of spring-coupled chains: derive, generate, simulate, identify.",
)
for name, command in COMMANDS.items():
    app.command(name, cls=CheckedCommand, epilog=examples_of(name))(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on the given arguments (those of the process if None) and exit."""
    app(args=arguments, prog_name="modelgen")
