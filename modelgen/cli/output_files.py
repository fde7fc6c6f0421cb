"""Files that identify writes: each place is checked before any work, and written when the work is done."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.atomic_write import check_place, write_whole
from modelgen.errors import DataError
from modelgen.progress import step

if TYPE_CHECKING:
    from modelgen.cli.options import ResultOptions
    from modelgen.cli.sensor_sets.identified import Identified

FIGURES = (".png", ".svg", ".pdf")
REPORTS = (".html", ".htm")


@dataclass(frozen=True)
class OutputFiles:
    """The files of an estimate, its report, its figure and its project; None for what was not asked for."""

    estimate: Path | None
    report: Path | None
    figure: Path | None
    overwrite: bool
    project: Path | None = None

    @property
    def paths(self) -> list[Path]:
        """The files to write."""
        asked = (self.estimate, self.report, self.figure, self.project)
        return [path for path in asked if path is not None]

    def check(self, spec: str | None = None, controller: Path | None = None, arm: bool = False) -> None:
        """Check that every file can be written, and read what the report is to be made with.

        The controller is that of an arm, or of a chain.

        Raises
        ------
        DataError
        """
        places = ((self.estimate, ()), (self.report, REPORTS), (self.figure, FIGURES))
        for path, suffixes in (*places, (self.project, (".toml",))):
            if path is not None:
                check_output(path, suffixes, self.overwrite)
        if self.report is not None:
            from modelgen.cli.write_report import check_inputs

            check_inputs(spec, controller, arm)

    def write(
        self,
        found: Identified,
        module: Path,
        options: Mapping[str, Any],
        spec: str | None,
        controller: Path | None,
    ) -> None:
        """Write all but the project; `spec`, `controller` as in `modelgen.cli.write_report.report_text`."""
        estimate = found.estimate
        if self.estimate is not None:
            write_whole(self.estimate, estimate.to_json().encode(), overwrite=self.overwrite)
        if self.report is not None:
            from modelgen.cli.write_report import report_text

            step("writing the report")
            page = report_text(found, module, options, spec, controller)
            write_whole(self.report, page.encode(errors="backslashreplace"), overwrite=self.overwrite)
        if self.figure is not None:
            from modelgen.cli.figure import write_figure

            write_figure(self.figure, found, self.overwrite)


def refuse_idle(report: Path | None, given: Mapping[str, object]) -> None:
    """Refuse options, by their names, that say how a report is made where none is asked for.

    Raises
    ------
    DataError
    """
    idle = [name for name, value in given.items() if value is not None and report is None]
    if idle:
        what = f"is missing: without it {' and '.join(idle)} would do nothing"
        raise DataError.at("--report", what, f"give --report, or leave {' and '.join(idle)} out")


def check_result(how: ResultOptions) -> None:
    """Check the file of an answer, if one is asked for, before any work is done; raises as `check_output`."""
    if how.output is not None:
        check_output(how.output, (), how.overwrite)


def check_output(path: Path, suffixes: Sequence[str], overwrite: bool) -> None:
    """Check the path of a result before any work is done for it.

    Raises
    ------
    DataError
        For a suffix that is none of `suffixes` (any suffix is accepted if there are none), a place that
        cannot be written, and a file that exists and may not be replaced.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise DataError.at(str(path), f"has the suffix {path.suffix!r}", f"give it {' or '.join(suffixes)}")
    check_place(path)
    if not path.parent.is_dir():
        raise DataError.at(str(path), f"has no folder {path.parent}", "create the folder first")
    if not os.access(path.parent, os.W_OK):
        what = f"cannot be written: nothing may be, in the folder {path.parent}"
        raise DataError.at(str(path), what, "check its permissions, or choose another folder")
    if path.exists() and not overwrite:
        raise DataError.at(str(path), "exists already", "choose another name, or give --overwrite")
