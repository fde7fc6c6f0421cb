"""Run a project: its groups of records identified, its history extended, the last one's files written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modelgen.atomic_write import write_whole
from modelgen.cli.data_arguments import reading_lines
from modelgen.cli.output import note
from modelgen.cli.project.prepared import Prepared, prepare
from modelgen.cli.sensor_sets.identified import Identified, identified, read_for
from modelgen.errors import ModelgenError, Problem
from modelgen.progress import step
from modelgen.project.history import HistoryEntry, append, load_history
from modelgen.project.lock_file import Lock, file_hash, load_lock, own_outputs, record_hashes, save_lock
from modelgen.project.project_file import Project
from modelgen.project.tables import RecordsTable

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Ran:
    """What a run did.

    Entries and whether each is new, why groups have no estimate; what the last group gave; names of the files
    that were written, and of records that are new in the lock.
    """

    entries: tuple[tuple[HistoryEntry, bool], ...]
    failed: tuple[ModelgenError, ...]
    found: Identified
    written: tuple[str, ...]
    locked: tuple[str, ...]

    @property
    def estimate(self) -> Estimate:
        """That of the last group."""
        return self.entries[-1][0].estimate


def run_project(project: Project, renew: bool, overwrite: bool, trust: bool) -> Ran:
    """Identify the groups of a project that its history does not have, and the last one in any case.

    Parameters
    ----------
    project : Project
    renew : bool
        Take records as they are now, whatever the lock says.
    overwrite : bool
        Replace files that a run did not write.
    trust : bool
        Execute a module that modelgen did not write.

    Raises
    ------
    ModelgenError
    """
    lock = load_lock(project.lock) if project.lock.exists() else Lock()
    output = project.table.output
    names = [name for name in (output.estimate, output.report) if name is not None]
    own_outputs(project, lock, names, overwrite)
    hashes = record_hashes(project, lock, renew)
    prepared = prepare(project, trust)
    save_lock(project.lock, Lock(records=hashes, written=lock.written))
    before = load_history(project.history) if project.history.exists() else ()
    known = {entry.inputs: entry for entry in before}
    entries: list[tuple[HistoryEntry, bool]] = []
    found: Identified | None = None
    failed: list[ModelgenError] = []
    groups = project.table.records
    for group in groups:
        inputs = prepared.inputs(group, hashes)
        if inputs in known and group is not groups[-1]:
            entries.append((known[inputs], False))
            continue
        try:
            found = _identified(prepared, group)
        except ModelgenError as error:
            failed.append(error)  # the other months are not lost with this one
            if group is groups[-1]:
                raise type(error)(*(problem for one in failed for problem in one.problems)) from error
            continue
        own = {name: hashes[name] for name in group.files}
        entry = HistoryEntry(project.name, group.date, own, inputs, found.estimate)
        entries.append((entry, append(project.history, entry)))
    assert found is not None  # the last group is identified in any case
    written = _write(prepared, found)
    after = {**lock.written, **{name: file_hash(project.place(name)) for name in names}}
    save_lock(project.lock, Lock(records=hashes, written=after))
    new = tuple(name for name, one in hashes.items() if lock.records.get(name) != one)
    return Ran(tuple(entries), tuple(failed), found, tuple(written), new)


def _identified(prepared: Prepared, group: RecordsTable) -> Identified:
    """Return the estimate of a group; a mistake names the group."""
    label = group.files[0] if group.date is None else group.date.isoformat()
    paths = [prepared.project.place(name) for name in group.files]
    step(f"identifying {label}")
    try:
        tags = [f"{name}={tag}" for name, tag in group.tags.items()]
        read = read_for(paths, prepared.models, prepared.given, tags, group.sensors, (), group.payloads)
        try:
            return identified(prepared.models, read, prepared.settings)
        finally:  # what was found in the files may be why there is no estimate
            note(reading_lines(paths, [one for _, one in read]))
    except ModelgenError as error:
        where = f"{prepared.project.path}: records of {label}"
        raise type(error)(
            *(Problem(f"{where}: {one.where}", one.what, one.remedy) for one in error.problems)
        ) from error


def _write(prepared: Prepared, found: Identified) -> list[str]:
    """Write what the project asks for, where it is not there already to the byte."""
    from modelgen.cli.write_report import report_text

    project, output = prepared.project, prepared.project.table.output
    contents: dict[str, str] = {}
    if output.estimate is not None:
        contents[output.estimate] = found.estimate.to_json()
    if output.report is not None:
        step("writing the report")
        contents[output.report] = report_text(
            found, prepared.module, prepared.described(), prepared.spec, None
        )
    return [name for name, text in contents.items() if _changed(project.place(name), text)]


def _changed(path: Path, text: str) -> bool:
    data = text.encode()
    if path.is_file() and not path.is_symlink() and path.stat().st_size == len(data):
        from modelgen.read_file import OUTPUT, read_bytes

        if read_bytes(path, OUTPUT) == data:
            return False
    write_whole(path, data, overwrite=True)
    return True


def facts_of(project: Project, ran: Ran) -> Mapping[str, object]:
    """Return what a run did as plain values."""
    return {
        "project": project.name,
        "history": str(project.history),
        "entries": [
            {"label": entry.label, "records": dict(entry.records), "added": added}
            for entry, added in ran.entries
        ],
        "failed": [str(problem) for error in ran.failed for problem in error.problems],
        "locked": list(ran.locked),
        "written": [str(project.place(name)) for name in ran.written],
        "estimate": ran.estimate.to_dict(),
    }
