"""`modelgen import`: channels of a data file, and a mapping for `identify --map-file`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modelgen.cli.options import Json, Overwrite, Trust
from modelgen.cli.output import report


def import_file(
    data: Annotated[Path, typer.Argument(metavar="FILE", help="A data file of any format modelgen reads.")],
    module: Annotated[
        Path | None, typer.Option("--model", metavar="MODULE.py", help="The model whose channels to find.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="MAP.toml", help="FILE.map.toml if left out.")
    ] = None,
    trust: Trust = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Show a data file's channels, propose which is which, and write that as TOML for identify --map-file.

    Nothing is mended: what is uneven, missing, doubled or offset is listed with its size.
    """
    from modelgen.atomic_write import write_whole
    from modelgen.cli.import_file import describe_file, import_lines
    from modelgen.runtime.files.joined.joined_source import paths_of
    from modelgen.runtime.model.model import load_model

    described = describe_file(data, load_model(module, trust) if module else None)
    first = paths_of(data)[0]
    path = output or first.with_name(f"{first.stem}.map.toml")
    write_whole(path, described["mapping"].encode(), overwrite=overwrite)
    described["written"] = [str(path)]
    report(described, import_lines(described, path, module), as_json)
