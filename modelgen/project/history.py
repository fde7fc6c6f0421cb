"""The history of a project: one line of JSON an estimate, in the order they were made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date as Date
from pathlib import Path
from typing import Any

from modelgen.atomic_write import write_whole
from modelgen.documents import json_document
from modelgen.errors import DataError, ModelgenError, Problem
from modelgen.read_file import HISTORY, read_text
from modelgen.runtime.results.estimate import Estimate
from modelgen.typed_values import typed

FORMAT, VERSION = "modelgen history entry", 1


@dataclass(frozen=True)
class _Head:
    """What an entry says besides its estimate."""

    format: str
    version: int
    project: str
    date: str | None
    records: Mapping[str, str]
    inputs: str


@dataclass(frozen=True, eq=False)
class HistoryEntry:
    """One estimate of a project.

    Attributes
    ----------
    project : str
        What it is of.
    date : date or None
        As the project file states it.
    records : mapping of str to str
        Data file to its SHA-256.
    inputs : str
        SHA-256 of everything that the estimate depends on.
    estimate : Estimate
    """

    project: str
    date: Date | None
    records: Mapping[str, str]
    inputs: str
    estimate: Estimate

    @property
    def label(self) -> str:
        """The date, or the names of the records."""
        return ", ".join(self.estimate.records) if self.date is None else self.date.isoformat()

    def line(self) -> str:
        """Return the entry as one line, the same for the same entry."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "project": self.project,
            "date": None if self.date is None else self.date.isoformat(),
            "records": dict(self.records),
            "inputs": self.inputs,
            "estimate": self.estimate.to_dict(),
        }
        return json.dumps(document, allow_nan=False) + "\n"


def load_history(path: Path) -> tuple[HistoryEntry, ...]:
    """Read all entries of a history.

    Raises
    ------
    DataError
        When the file cannot be read or is empty; with at least one problem per line that is no entry.
    """
    entries, problems = [], list[Problem]()
    for number, line in enumerate(read_text(path, HISTORY).split("\n"), 1):
        if line.strip():
            try:
                entries.append(_entry(line, f"{path}: line {number}"))
            except ModelgenError as error:
                problems += error.problems
    if not entries and not problems:
        problems = [Problem(str(path), "holds no entry", HISTORY.remedy)]
    DataError.raise_any(problems)
    return tuple(entries)


def append(path: Path, entry: HistoryEntry) -> bool:
    """Add an entry behind the others, unless the history has the very same one; return whether it was added.

    The file is written whole or not at all. It is read again for it: another run may have added to it.
    """
    text = read_text(path, HISTORY) if path.exists() else ""
    line = entry.line()
    if line in text.splitlines(keepends=True):
        return False
    between = "" if not text or text.endswith("\n") else "\n"
    write_whole(path, f"{text}{between}{line}".encode(), overwrite=True)
    return True


def _entry(line: str, where: str) -> HistoryEntry:
    document: Any = json_document(line, where, HISTORY.remedy)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise DataError.at(where, "is no entry of a history", HISTORY.remedy)
    problems: list[Problem] = []
    rest = {key: value for key, value in document.items() if key != "estimate"}
    head = typed(_Head, rest, f"{where}: ", HISTORY.remedy, problems)
    if problems or not isinstance(head, _Head):
        raise DataError(*problems)
    if head.version != VERSION:
        raise DataError.at(f"{where}: version", f"is {head.version}", f"this modelgen reads {VERSION}")
    estimate = Estimate.from_dict(document.get("estimate", {}), f"{where}: estimate")
    return HistoryEntry(head.project, _date(head.date, where), head.records, head.inputs, estimate)


def _date(text: str | None, where: str) -> Date | None:
    try:
        return None if text is None else Date.fromisoformat(text)
    except ValueError:
        raise DataError.at(f"{where}: date", f"{text!r} is no date", HISTORY.remedy) from None
