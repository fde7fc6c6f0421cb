"""Data files and their options (--map, --scale, --map-file, --mend, ...) -> readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.arguments import directions_from
from modelgen.cli.options import (
    Columns,
    Directions,
    MapFile,
    Mend,
    SamplingFrequency,
    Scales,
    TimeColumn,
    TimeUnit,
)
from modelgen.errors import DataError, Problem
from modelgen.progress import counted

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.mapping_file import MappingFile
    from modelgen.runtime.records.read_record import Reading

# inputs of a closed loop: the first is needed for every simulation, the others are used where they are mapped
REFERENCE = ("reference",)
FURTHER_INPUTS = ("reference_rate", "feedforward")


@dataclass(frozen=True)
class DataOptions:
    """Options for reading data files; None for those that were not given."""

    mapping: Columns = None
    scale: Scales = None
    map_file: MapFile = None
    fs: SamplingFrequency = None
    time: TimeColumn = None
    time_unit: TimeUnit = None
    mend: Mend = None
    direction: Directions = None


def read_files(
    paths: Sequence[Path],
    models: Sequence[Model],
    options: DataOptions,
    extra: Sequence[str] = (),
    optional: Sequence[str] = (),
) -> list[Reading]:
    """Read one record a file, and report the mistakes of all of them at once.

    Options given on the command line go before those of the mapping file; `extra` names channels that the
    records must bring in addition to those of the models, `optional` those they may bring where they are
    mapped. A mapping file may map the reference of the loop even where it is not needed.
    """
    from modelgen.runtime.records.read_record import read

    how = reading_options(models, options, extra, optional)
    readings: list[Reading] = []
    problems: list[Problem] = []
    for path in counted(paths, "reading"):
        try:
            reading = read(path, **how)
        except DataError as error:
            problems += error.problems
            continue
        if any(model.is_arm for model in models):  # joints have nothing to do with each other's zeros
            kept = [one for one in reading.findings if not one.kind.startswith("offset=")]
            reading = replace(reading, findings=tuple(kept))
        readings.append(reading)
    DataError.raise_any(problems)
    return readings


def reading_options(
    models: Sequence[Model], options: DataOptions, extra: Sequence[str] = (), optional: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the options of `read` that the command line and a mapping file give; parameters as above."""
    from modelgen.runtime.records.directions import wanted_directions
    from modelgen.runtime.records.mapping_file import MappingFile, load_mapping
    from modelgen.runtime.records.mapping_options import parse_mapping, parse_scales
    from modelgen.runtime.records.record import missing_name

    given: MappingFile = load_mapping(options.map_file) if options.map_file else MappingFile()
    columns = {**given.columns, **parse_mapping(options.mapping or ())}
    factors = {**given.scales, **parse_scales(options.scale or ())}
    # a misspelt key would leave the channel to a column that happens to have its name
    units = {key: unit for model in models for key, unit in model.channel_units.items()}
    sources = directions_from(options.direction or ())
    # an estimate may know directions from other channels, and says it where it does not
    turning = {key for model in models for key in wanted_directions(model)}
    measured = [
        key for model in models for key in model.channels if key not in sources and key not in turning
    ]
    welcome = [key for model in models for key in (*model.loads, *sorted(turning - sources.keys()))]
    mapped = [key for key in (*optional, *welcome) if key in columns]
    wanted = tuple(dict.fromkeys((*measured, *sources.values(), *extra, *mapped)))
    channels = dict.fromkeys((*units, *welcome, *wanted, *REFERENCE, *FURTHER_INPUTS))
    where = str(options.map_file) if options.map_file else "--map"
    problems = [missing_name(where, "channel", key, channels) for key in columns if key not in channels]
    DataError.raise_any(problems)
    return {
        "mapping": columns,
        "scales": {key: one for key, one in factors.items() if key in wanted or key not in channels},
        "fs": options.fs if options.fs is not None else given.fs_hz,
        "time": options.time or given.time,
        "needed": wanted,
        "welcome": welcome,
        "time_unit": options.time_unit or given.time_unit,
        "mend": (*given.mend, *(options.mend or ())),
        "units": units,
        "stated_units": given.units,
    }


def tagged(readings: Sequence[Reading], given: Sequence[str]) -> list[Reading]:
    """Return the readings with the tags that --tag gives to their records."""
    from modelgen.runtime.records.mapping_options import parse_names
    from modelgen.runtime.records.record import missing_name

    tags = parse_names("--tag", given)
    names = [reading.record.name for reading in readings]
    problems = [missing_name("--tag", "record", name, names) for name in tags if name not in names]
    DataError.raise_any(problems)
    return [
        replace(
            reading, record=replace(reading.record, tag=tags.get(reading.record.name, reading.record.tag))
        )
        for reading in readings
    ]


def carrying(readings: Sequence[Reading], given: Sequence[str], models: Sequence[Model]) -> list[Reading]:
    """Return the readings whose records carry what --payload says, RECORD=NAME or NAME of all of them."""
    from modelgen.runtime.records.record import missing_name

    names = [reading.record.name for reading in readings]
    payloads = [key.removeprefix("load_") for model in models for key in model.loads]
    if given and not payloads:
        remedy = "write a table [payload.NAME] into the arm's spec and generate its module again"
        raise DataError.at("--payload", "the model has no payload", remedy)
    carried: dict[str, list[str]] = {name: [] for name in names}
    problems = []
    for item in given:
        record, _, payload = item.rpartition("=")
        if record and record not in names:
            problems.append(missing_name("--payload", "record", record, names))
        elif payload not in payloads:
            problems.append(missing_name("--payload", "payload", payload, payloads))
        for name in [record] if record in names else names:
            carried[name].append(payload)
    DataError.raise_any(problems)
    return [
        replace(reading, record=reading.record.carrying(*carried[reading.record.name]))
        for reading in readings
    ]


def reading_lines(paths: Sequence[Path], readings: Sequence[Reading]) -> list[str]:
    """Return how the files were interpreted, their faults, and what was repaired."""
    lines = []
    for path, reading in zip(paths, readings, strict=True):
        lines += [f"{path}: took: {text}" for text in reading.took]
        lines += [f"{path}: found: {finding.what} (--mend {finding.kind})" for finding in reading.findings]
        lines += [f"{path}: mended: {text}" for text in reading.mended]
    return lines
