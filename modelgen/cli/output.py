"""Output of commands: notes and mistakes on stderr, results as lines of text or as strict JSON."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import typer

from modelgen.atomic_write import write_whole
from modelgen.documents import plain_json
from modelgen.errors import Problem, visible
from modelgen.progress import is_terminal

if TYPE_CHECKING:
    from modelgen.cli.options import ResultOptions

LISTED = 100  # mistakes; more of them have one cause


def note(lines: Sequence[str]) -> None:
    """Print notes for the user on stderr, apart from the result."""
    with suppress(OSError):  # a full disk, a closed pipe: the answer itself goes elsewhere
        for line in lines:
            typer.echo(visible(line), err=True)


def explain(problem: Problem) -> None:
    """Print a mistake on stderr: what is wrong and what to do, on a terminal in two lines and in colour."""
    if not is_terminal(sys.stderr):
        note([f"error: {problem}"])
        return
    # see https://no-color.org; some terminals cannot show colours
    colour = False if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" else None
    typer.secho("error: ", fg="red", bold=True, nl=False, err=True, color=colour)
    typer.echo(f"{problem.where}: {problem.what}", err=True)
    typer.secho("  try: ", fg="green", nl=False, err=True, color=colour)
    typer.echo(problem.remedy, err=True)


def explain_all(problems: Sequence[Problem]) -> None:
    """Print the first hundred mistakes and the number of the others."""
    for problem in problems[:LISTED]:
        explain(problem)
    if len(problems) > LISTED:
        note([f"error: and {len(problems) - LISTED} more"])


def report(facts: dict[str, Any], lines: Sequence[str], as_json: bool) -> None:
    """Print what was done, as JSON or as lines of text."""
    if as_json:
        print_json(facts)
    else:
        typer.echo("\n".join(visible(part) for line in lines for part in line.split("\n")))


def print_json(value: Any) -> None:
    """Print strict JSON: what is not finite becomes null."""
    typer.echo(_json_text(value))


def deliver(facts: Any, printed: Callable[[], None], how: ResultOptions) -> None:
    """Save the facts where a file is asked for, and print them: as JSON, or as `printed` does."""
    if how.output is not None:
        write_whole(how.output, (_json_text(facts) + "\n").encode(), overwrite=how.overwrite)
        note([f"wrote {how.output}"])
    if how.as_json:
        print_json(facts)
    else:
        printed()


def _json_text(value: Any) -> str:
    text = json.dumps(plain_json(value), indent=2, ensure_ascii=False, allow_nan=False)
    if not text.replace("\n", "").isprintable():  # JSON itself allows some characters that steer a terminal
        text = "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)
    return text
