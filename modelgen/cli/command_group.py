"""The group of all commands: each mistake with its remedy on one line, and an exit code.

Exit codes: 0 done, 1 the data do not determine the result (or a check failed), 2 wrong input.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from modelgen.cli.examples import PURPOSES
from modelgen.cli.output import explain, explain_all, note
from modelgen.errors import LONGEST, DataError, ModelgenError, Problem
from modelgen.magnitudes import FREQUENCY_REMEDY, LARGEST_COUNT, REMEDY, is_frequency, is_usable
from modelgen.progress import shown

# typer brings its own copy of click, whose errors it does not export; they share this base
UsageError: Any = typer.BadParameter.__mro__[1]
# metavariables of texts that hold numbers
NUMBER_WORDS = {"STD", "STEP", "ERROR", "PEAK", "AMOUNT", "FACTOR", "SECONDS", "SHARE", "HZ", "VALUE"}
# errors of a library whose arithmetic fails; its result would be meaningless
ARITHMETIC = (RuntimeWarning, FloatingPointError, OverflowError, ZeroDivisionError)


# options that name a file to write
WRITTEN = {"-o", "--report", "--figure", "--save-project", "--svg", "--plot", "--optimise"}


class CheckedCommand(TyperCommand):
    """A command none of whose options holds a number that nothing can be calculated with, or writes to a file
    that another one names.
    """

    def invoke(self, ctx: Any) -> Any:
        """Run the command.

        Raises
        ------
        DataError
            With one problem per option that is out of range, or whose file is another option's.
        """
        problems = [
            problem
            for parameter in self.params
            for value in _listed(ctx.params.get(parameter.name))
            for problem in _number_problems(parameter, value)
        ]
        problems += _replaced([(one, ctx.params.get(one.name)) for one in self.params])
        DataError.raise_any(problems)
        return super().invoke(ctx)


class ExplainedGroup(TyperGroup):
    """Prints every mistake of a command on a line of its own, and ends with its exit code."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run the command line; a failure to write to the standard output is reported, too."""
        try:
            return super().main(*arguments, **options)
        except OSError as error:  # outside of any command: the help, on a full disk
            _explain_os_error(error)
            sys.exit(2)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the commands by purpose."""
        for purpose, names in PURPOSES.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            rows = [(name, one.get_short_help_str(LONGEST)) for name, one in commands if one is not None]
            if rows:
                with formatter.section(purpose):
                    formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run a command and explain the errors that end it."""
        try:
            with shown(), warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                return super().invoke(ctx)
        except ModelgenError as error:
            explain_all(error.problems)
            raise typer.Exit(error.exit_code) from error
        except UsageError as error:
            command = error.ctx.command_path if error.ctx else "modelgen"
            what = error.format_message().strip().rstrip(".").replace("\n", " ")
            explain(Problem(command, what, f"see {command} --help"))
            raise typer.Exit(2) from error
        except BrokenPipeError:
            raise  # the reader of a pipe has gone: typer ends quietly
        except OSError as error:
            _explain_os_error(error)
            raise typer.Exit(2) from error
        except MemoryError as error:
            explain(Problem("memory", "is not enough", "give fewer, shorter or decimated records"))
            raise typer.Exit(2) from error
        except ARITHMETIC as error:
            remedy = "check magnitudes and units of records, options, parameters and the sampling frequency"
            explain(Problem("arithmetic", f"fails ({error})", remedy))
            raise typer.Exit(2) from error
        except KeyboardInterrupt as error:
            note(["interrupted"])
            raise typer.Exit(130) from error


def _explain_os_error(error: OSError) -> None:
    # errors of files that are read or written are reported where they occur
    where = str(error.filename or "standard output")
    explain(Problem(where, str(error.strerror or error), "check where it leads to, and its permissions"))


def _listed(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


def _replaced(given: Sequence[tuple[Any, Any]]) -> list[Problem]:
    """Return one problem per file to write that another option names: it would be lost with --overwrite."""
    return [
        Problem(
            f"{option.opts[0]} {value}",
            f"is the file of {other.opts[0] if other.opts[0][0] == '-' else other.metavar}, too",
            "choose another name",
        )
        for option, value in given
        if value is not None and WRITTEN & set(option.opts)
        for other, values in given
        if other is not option
        and (os.path.isfile(value) or WRITTEN & set(other.opts))
        and _place(value) in map(_place, _files(values))
    ]


def _files(value: Any) -> list[str]:
    """Return what may name a file in an option's value: records, or a text with commas between them."""
    texts = [str(one) for one in _listed(value) if isinstance(one, (str, Path))]
    return [part for text in texts for part in (text, *text.split(","))]


def _place(path: Any) -> str:
    return os.path.realpath(str(path).replace("\0", ""))


def _number_problems(parameter: Any, value: Any) -> list[Problem]:
    """Return what is wrong with a number, or with those in a text such as q_m=2e-5 or 100,200."""
    option = parameter.opts[0]
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        return [Problem(option, "is too large a number", f"give one up to {LARGEST_COUNT}")]
    if isinstance(value, str) and set(re.findall("[A-Z]+", parameter.metavar or "")) & NUMBER_WORDS:
        numbers = [_number_of(part) for part in value.rpartition("=")[2].split(",")]
        if not all(map(is_usable, numbers)):
            return [Problem(f"{option} {value}", "cannot be calculated with", REMEDY)]
    if not isinstance(value, float):
        return []
    if (parameter.name == "fs" or parameter.name.endswith("_hz")) and not is_frequency(value):
        return [Problem(f"{option} {value}", "is no frequency", FREQUENCY_REMEDY)]
    if not is_usable(value):
        return [Problem(f"{option} {value}", "cannot be calculated with", REMEDY)]
    return []


def _number_of(text: str) -> float:
    """Return the number that a text is, zero where it is none: the command reports that."""
    try:
        return float(text)
    except ValueError:
        return 0.0
