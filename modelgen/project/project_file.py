"""A project's TOML file -> Project: every mistake at once, each with its key; paths relative to the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from modelgen.documents import leaves, toml_document
from modelgen.errors import DataError, Problem
from modelgen.magnitudes import FREQUENCY_REMEDY, LARGEST_COUNT, REMEDY, is_frequency, is_usable
from modelgen.project.tables import ProjectTable
from modelgen.read_file import PROJECT, read_text
from modelgen.typed_values import typed

SUFFIXES = {"estimate": (".json",), "report": (".html", ".htm"), "history": (".jsonl",)}


@dataclass(frozen=True)
class Project:
    """A project file: its tables, and where the files that they name are."""

    path: Path
    table: ProjectTable

    @property
    def stem(self) -> str:
        """The file's name without .project.toml or .toml."""
        return self.path.name.removesuffix(".toml").removesuffix(".project")

    @property
    def name(self) -> str:
        """What the history is of: a machine, an axis."""
        return self.table.name or self.stem

    @property
    def lock(self) -> Path:
        """The file of hashes."""
        return self.path.with_name(f"{self.stem}.project.lock")

    @property
    def history(self) -> Path:
        """The file of all estimates."""
        return self.place(self.table.output.history or f"{self.stem}.history.jsonl")

    def place(self, name: str) -> Path:
        """Return the path of a file that the project names."""
        return self.path.parent / name


def load_project(path: Path, with_records: bool = True) -> Project:
    """Read a project file; without its records, these need not be there any more.

    Raises
    ------
    DataError
        With one problem per mistake: a key that is missing or unknown, a value of another type or that
        nothing can be calculated with, a file that is absent or named twice, an output outside the folder.
    """
    where = f"{path}: "
    if path.suffix != ".toml":
        raise DataError.at(str(path), "is no .toml file", PROJECT.remedy)
    document = toml_document(read_text(path, PROJECT), str(path), ("records", "model", "spec"))
    problems: list[Problem] = []
    remedy = "write it as docs/how-to/monitor.md shows"
    table = typed(ProjectTable, document, where, remedy, problems)
    if problems:  # what can be read is checked all the same
        left = _without(document, [problem.where.removeprefix(where) for problem in problems])
        table = typed(ProjectTable, left, where, remedy, [])
    if isinstance(table, ProjectTable):
        project = Project(path, table)
        problems += _number_problems(where, table)
        problems += _output_problems(where, project)
        problems += _model_problems(where, table) if len(table.records) else []
        if with_records and (len(table.records) or not problems):
            problems += _record_problems(where, project)
    DataError.raise_any(problems)
    return project


def _without(document: Mapping[str, Any], wrong: Sequence[str]) -> dict[str, Any]:
    """Return a document without the keys that are wrong, nor any records where some of those are."""
    left = {key: dict(value) if isinstance(value, dict) else value for key, value in document.items()}
    for place in wrong:
        table, _, key = place.partition(".")
        if isinstance(left.get(table), dict) and key.partition(".")[0] in left[table]:
            del left[table][key.partition(".")[0]]
        elif table.startswith("records"):
            left["records"] = []
        else:
            left.pop(table, None)
    return left


def _number_problems(where: str, table: ProjectTable) -> list[Problem]:
    """Return which numbers nothing can be calculated with."""
    problems = []
    for key, value in leaves(table):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        if isinstance(value, int) and abs(value) > LARGEST_COUNT:
            problems.append(Problem(f"{where}{key}", "is too large", f"give one up to {LARGEST_COUNT}"))
        elif "_hz" in key or "scan_cutoffs" in key:
            if not is_frequency(value):
                problems.append(Problem(f"{where}{key}", f"is {value!r}, no frequency", FREQUENCY_REMEDY))
        elif not is_usable(value):
            problems.append(Problem(f"{where}{key}", f"is {value!r}", REMEDY))
        elif value == 0.0 and key.startswith("data.scales"):
            problems.append(Problem(f"{where}{key}", "is zero", "give the factor to SI units"))
    return problems


def _model_problems(where: str, table: ProjectTable) -> list[Problem]:
    problems = []
    if (table.spec is None) == (table.model is None):
        what = "is missing" if table.spec is None else "is given together with model"
        remedy = 'give either spec = "CHAIN.toml" with sensors = "SET", or model = "MODULE.py"'
        problems.append(Problem(f"{where}spec", what, remedy))
    if table.spec is not None and table.sensors is None:
        problems.append(Problem(f"{where}sensors", "is missing", "name a sensor set of the spec"))
    if table.model is not None and table.sensors:
        remedy = "give spec in place of model: a module has its sensors in it"
        problems.append(Problem(f"{where}sensors", "has no effect together with model", remedy))
    return problems


def _record_problems(where: str, project: Project) -> list[Problem]:
    problems, seen = [], dict[Path, str]()
    groups = project.table.records
    if not groups:
        problems.append(Problem(f"{where}records", "is empty", 'write [[records]] with files = ["RUN.csv"]'))
    for index, group in enumerate(groups):
        key = f"{where}records[{index}]"
        if not group.files:
            problems.append(Problem(f"{key}.files", "is empty", "name at least one data file"))
        if group.date is None and any(one.date for one in groups):
            problems.append(Problem(f"{key}.date", "is missing", "date all groups of records, or none"))
        for place, name in enumerate(group.files):
            path = project.place(name)
            if not _is_file(path):
                what = f"names {name}, which is no file"
                problems.append(Problem(f"{key}.files[{place}]", what, "paths start at the project file"))
                continue
            twice = seen.setdefault(path.resolve(), f"records[{index}].files[{place}]")
            if twice != f"records[{index}].files[{place}]":
                problems.append(Problem(f"{key}.files[{place}]", f"is the file of {twice}", "name it once"))
    return problems


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, a null byte
        return False


def _output_problems(where: str, project: Project) -> list[Problem]:
    """Return what is wrong with places to write: they must be the project's own."""
    problems = []
    output = project.table.output
    given = [name for group in project.table.records for name in group.files]
    for key, suffixes in SUFFIXES.items():
        name = getattr(output, key)
        if name is None:
            continue
        parts = PurePosixPath(name.replace("\\", "/"))
        outside = parts.is_absolute() or ".." in parts.parts or ":" in name or not name.isprintable()
        if outside or not parts.name:
            what, remedy = f"names {name!r}", "give a path below the folder of the project file"
            problems.append(Problem(f"{where}output.{key}", what, remedy))
        elif parts.suffix.lower() not in suffixes:
            remedy = f"give it {' or '.join(suffixes)}"
            problems.append(Problem(f"{where}output.{key}", f"has the suffix {parts.suffix!r}", remedy))
        elif name in given:
            problems.append(Problem(f"{where}output.{key}", "is one of the records", "give another name"))
    return problems
