"""identify --save-project: what was typed on the command line, as the file of a project."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from modelgen.atomic_write import write_whole
from modelgen.cli.arguments import amounts, directions_from, load_chain, sensor_sets
from modelgen.cli.estimation_options import identify_table
from modelgen.cli.output_files import OutputFiles
from modelgen.cli.sensor_sets.identified import sensors_from
from modelgen.errors import DataError
from modelgen.project.lock_file import Lock, file_hash, save_lock
from modelgen.project.project_file import load_project
from modelgen.project.project_text import project_text
from modelgen.project.tables import DataTable, OutputTable, ProjectTable, RecordsTable


def save_project(outputs: OutputFiles, typed: Mapping[str, Any]) -> None:
    """Write the project file with which `modelgen run` does what `identify` did with what was typed.

    Its lock holds the records that were read and the files that were written. Nothing is written where
    `outputs` has none. Outputs that are not below its folder are left out: a project writes below its own.

    Raises
    ------
    ModelgenError
        When the file cannot be written, or a path is on another drive than it.
    """
    from modelgen.runtime.records.mapping_options import parse_mapping, parse_names, parse_scales

    path = outputs.project
    if path is None:
        return
    files = tuple(_relative(one, path) for one in typed["data"])
    map_file = typed["map_file"]
    sets, of_records = sensors_from(typed["sensors"] or ())
    table = ProjectTable(
        records=(
            RecordsTable(
                files,
                tags=parse_names("--tag", typed["tag"] or ()),
                sensors=of_records,
                payloads=tuple(typed["payload"] or ()),
            ),
        ),
        **_chain(typed, sets, path),
        known=amounts("--set", typed["value"] or ()),
        data=DataTable(
            None if map_file is None else _relative(map_file, path),
            parse_mapping(typed["mapping"] or ()),
            parse_scales(typed["scale"] or ()),
            typed["fs"],
            typed["time"],
            typed["time_unit"],
            tuple(typed["mend"] or ()),
            directions_from(typed["direction"] or ()),
        ),
        identify=identify_table(typed),
        output=OutputTable(_below(outputs.estimate, path), _below(outputs.report, path)),
    )
    write_whole(path, project_text(table).encode(), overwrite=outputs.overwrite)
    project = load_project(path)
    written = [name for name in (table.output.estimate, table.output.report) if name is not None]
    hashes = [{name: file_hash(project.place(name)) for name in names} for names in (files, written)]
    save_lock(project.lock, Lock(records=hashes[0], written=hashes[1]))


def _chain(typed: Mapping[str, Any], sets: Sequence[str], path: Path) -> dict[str, Any]:
    """Return the keys that say what was identified: modules, or a spec and its sensor sets."""
    modules = [_relative(module, path) for module in typed["module"] or ()]
    if modules:
        return {"model": modules[0] if len(modules) == 1 else tuple(modules)}
    spec = typed["spec"]
    chain = load_chain(spec)
    is_path = Path(spec).suffix or Path(spec).name != spec
    names = list(sets) or sensor_sets(chain, None)
    place = _relative(Path(spec), path) if is_path else spec
    return {"spec": place, "sensors": names[0] if len(names) == 1 else tuple(names)}


def _relative(place: Path, project: Path) -> str:
    try:
        found = Path(os.path.relpath(place.resolve(), project.resolve().parent)).as_posix()
    except ValueError as error:  # another drive of Windows
        remedy = "save the project on the drive of its files"
        raise DataError.at(str(place), f"cannot be reached from {project}", remedy) from error
    if found.isprintable():
        return found
    what = "has a name that a project file cannot hold (it is no UTF-8 text, or has control characters)"
    raise DataError.at(str(place), what, "rename it, or save the project in its folder")


def _below(place: Path | None, project: Path) -> str | None:
    name = None if place is None else _relative(place, project)
    return None if name is None or name.startswith("..") else name
