"""How commands answer: progress on stderr, then lines for the eye or strict JSON for programs."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from typing import Any

import typer


def say(step: str) -> None:
    """Show progress, unless stderr goes to a file or another program."""
    if sys.stderr.isatty():
        typer.echo(f"{step} ...", err=True)


def report(facts: dict[str, Any], lines: Sequence[str], as_json: bool) -> None:
    """Print what was done, for a program or for the eye."""
    if as_json:
        print_json(facts)
    else:
        typer.echo("\n".join(lines))


def print_json(value: Any) -> None:
    """Print strict JSON: what is not finite becomes null."""
    typer.echo(json.dumps(_finite(value), indent=2, ensure_ascii=False, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
