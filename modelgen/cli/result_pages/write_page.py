"""--report of validate, compare and fleet: what they print, as one HTML page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.atomic_write import write_whole
from modelgen.cli.output import note
from modelgen.cli.output_files import REPORTS, check_output
from modelgen.cli.result_pages.printed_parts import parts_of
from modelgen.progress import step

if TYPE_CHECKING:
    from modelgen.report.result_page import Interval
    from modelgen.runtime.simulation.validation import Validation

ReportFile = Annotated[
    Path | None, typer.Option("--report", metavar="FILE.html", help="Write everything as one HTML page.")
]


def check_report(path: Path | None, overwrite: bool) -> None:
    """Check the place of a page before any work is done for it."""
    if path is not None:
        check_output(path, REPORTS, overwrite)


def write_result_page(
    path: Path | None,
    overwrite: bool,
    title: str,
    printed: Any,
    context: typer.Context,
    intervals: Mapping[str, Sequence[Interval]] | None = None,
    validations: Sequence[Validation] = (),
) -> None:
    """Write what is printed (rich tables and texts, or lines) as a page, if one is asked for."""
    from modelgen.cli.arguments import given_options
    from modelgen.report.result_page import result_page

    if path is None:
        return
    step("writing the report")
    command, options = f"modelgen {context.info_name}", given_options(context)
    page = result_page(title, command, parts_of(printed), options, intervals, validations)
    write_whole(path, page.encode(errors="backslashreplace"), overwrite=overwrite)
    note([f"wrote {path}"])
