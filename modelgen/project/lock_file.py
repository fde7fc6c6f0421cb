"""The lock of a project: SHA-256 of the records it was identified from and of the files it wrote.

A record that has changed since is an error; a file that `run` wrote, and nobody changed, it may write again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from modelgen.atomic_write import write_whole
from modelgen.documents import json_document
from modelgen.errors import DataError, Problem
from modelgen.project.project_file import Project
from modelgen.read_file import LOCK, TEXT_DATA, open_file, read_text
from modelgen.typed_values import typed

BLOCK = 1 << 20  # bytes read at a time


@dataclass(frozen=True)
class Lock:
    """Hashes by path as the project file has it: of records read, and of files written."""

    format: str = "modelgen project lock"
    version: int = 1
    records: Mapping[str, str] = field(default_factory=dict)
    written: Mapping[str, str] = field(default_factory=dict)


def load_lock(path: Path) -> Lock:
    """Read a lock.

    Raises
    ------
    DataError
        When the file cannot be read; with one problem per mistake in it.
    """
    problems: list[Problem] = []
    document = json_document(read_text(path, LOCK), str(path), LOCK.remedy)
    lock = typed(Lock, document, f"{path}: ", LOCK.remedy, problems)
    if isinstance(lock, Lock) and (lock.format, lock.version) != (Lock.format, Lock.version):
        problems.append(Problem(f"{path}: format", "is another one", LOCK.remedy))
    DataError.raise_any(problems)
    assert isinstance(lock, Lock)
    return lock


def save_lock(path: Path, lock: Lock) -> None:
    """Write a lock, the same for the same hashes."""
    document = {
        "format": lock.format,
        "version": lock.version,
        "records": dict(sorted(lock.records.items())),
        "written": dict(sorted(lock.written.items())),
    }
    write_whole(path, (json.dumps(document, indent=2) + "\n").encode(), overwrite=True)


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file of any size, in hexadecimal digits."""
    found = hashlib.sha256()
    with open_file(path, TEXT_DATA) as file:
        while block := file.read(BLOCK):
            found.update(block)
    return found.hexdigest()


def record_hashes(project: Project, lock: Lock, renew: bool) -> dict[str, str]:
    """Return the hash of every record; those that the lock has must be as they were, unless it is renewed.

    Raises
    ------
    DataError
        With one problem per record that has changed: the file, and both hashes.
    """
    names = [name for group in project.table.records for name in group.files]
    found = {name: file_hash(project.place(name)) for name in names}
    problems = [
        Problem(
            str(project.place(name)),
            f"has changed: its SHA-256 is {one}, {project.lock.name} has {lock.records[name]}",
            f"bring the file back, or take it as it is now: modelgen run {project.path} --lock",
        )
        for name, one in found.items()
        if not renew and lock.records.get(name, one) != one
    ]
    DataError.raise_any(problems)
    return found


def own_outputs(project: Project, lock: Lock, names: Iterable[str], overwrite: bool) -> None:
    """Refuse to write over a file that `run` did not write, or that somebody changed afterwards.

    Raises
    ------
    DataError
    """
    problems = [
        Problem(
            str(project.place(name)),
            "exists, and is not what modelgen run wrote there",
            "move it away, name another file in [output], or give --overwrite",
        )
        for name in names
        if project.place(name).exists()
        and not overwrite
        and lock.written.get(name) != file_hash(project.place(name))
    ]
    DataError.raise_any(problems)
