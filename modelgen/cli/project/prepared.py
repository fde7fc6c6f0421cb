"""A project -> what its records are identified with: the model, the options, and a hash of all of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import modelgen
from modelgen.cli.data_arguments import DataOptions
from modelgen.cli.estimation_options import settings_of
from modelgen.errors import DataError
from modelgen.project.project_file import Project
from modelgen.project.tables import DataTable, RecordsTable
from modelgen.read_file import MAPPING, read_text

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the groups of a project are identified with.

    `spec` is the chain as `modelgen.cli.arguments.load_chain` takes it, None where the project names a
    module; `settings` are the options of `modelgen.identify`.
    """

    project: Project
    models: Mapping[str, Model]
    module: Path
    text: str
    spec: str | None
    given: DataOptions
    settings: Mapping[str, Any]

    def inputs(self, group: RecordsTable, hashes: Mapping[str, str]) -> str:
        """Return the SHA-256 of everything that a group's estimate depends on, this program included."""
        table, map_file = self.project.table, self.given.map_file
        told: dict[str, Any] = {
            "program": modelgen.__version__,
            "module": self.text,
            "data": asdict(table.data),
            "mapping": read_text(map_file, MAPPING) if map_file else None,
            "identify": asdict(table.identify),
            "records": {name: hashes[name] for name in group.files},
            "tags": dict(group.tags),
        }
        if table.model is not None and table.known:  # with a spec they are in the module
            told["known"] = dict(table.known)
        if group.sensors:
            told["sensors"] = dict(group.sensors)
        if group.payloads:
            told["payloads"] = list(group.payloads)
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()

    def described(self) -> dict[str, str]:
        """Return the options that the project states, for the report."""
        table = self.project.table
        found = {
            f"{part}.{name}": value
            for part, options in (("data", asdict(table.data)), ("identify", asdict(table.identify)))
            for name, value in options.items()
        }
        return {name: str(value) for name, value in found.items() if value not in (None, (), {})}


def prepare(project: Project, trust: bool) -> Prepared:
    """Return a project's model and options.

    Raises
    ------
    ModelgenError
        Of a spec, a module, a mapping file or options that are wrong.
    """
    from modelgen.runtime.model.known_parameters import with_known
    from modelgen.runtime.model.model import model_from_text

    table = project.table
    spec, texts = _module_texts(project)
    models = [model_from_text(text, str(module), trust) for module, text in texts]
    if table.model is not None:
        models = [with_known(model, table.known, f"{project.path}: known") for model in models]
    by_sensors = {model.sensor_set: model for model in models}
    if len(by_sensors) < len(models):
        raise DataError.at(f"{project.path}: model", "names sensors twice", "give one module a sensor set")
    text = "".join(text for _, text in texts)
    given = _given(project, table.data)
    settings = settings_of(table.identify, table.data.directions, given.map_file)
    return Prepared(project, by_sensors, texts[0][0], text, spec, given, settings)


def _module_texts(project: Project) -> tuple[str | None, list[tuple[Path, str]]]:
    """Return the chain if the project names one, and of each module the path to speak of and the text."""
    from modelgen.cli.arguments import load_chain
    from modelgen.render.writer import generate
    from modelgen.runtime.model.module_file import read_module
    from modelgen.spec.known_values import with_known

    table = project.table
    if table.model is not None:
        modules = [project.place(name) for name in _several(table.model)]
        return None, [(module, read_module(module)) for module in modules]
    name = str(table.spec)
    is_path = Path(name).suffix or Path(name).name != name
    spec = str(project.place(name)) if is_path else name
    chain = with_known(load_chain(spec), table.known, str(project.path))
    return spec, [(Path(spec), generate(chain, sensors)) for sensors in _several(table.sensors)]


def _several(given: str | tuple[str, ...] | None) -> tuple[str, ...]:
    return given if isinstance(given, tuple) else () if given is None else (given,)


def _given(project: Project, data: DataTable) -> DataOptions:
    return DataOptions(
        mapping=[f"{key}={column}" for key, column in data.columns.items()],
        scale=[f"{key}={factor}" for key, factor in data.scales.items()],
        map_file=None if data.map_file is None else project.place(data.map_file),
        fs=data.fs_hz,
        time=data.time,
        time_unit=data.time_unit,
        mend=list(data.mend),
        direction=[f"{name}={channel}" for name, channel in data.directions.items()],
    )
