"""modelgen import: contents and faults of a data file, and a proposed column for every channel."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.cli.reversed_sensors import with_reversed
from modelgen.errors import DataError, Problem, aligned, listed, shortened, visible
from modelgen.runtime.files.child_process.reader_process import DeadlyFileError
from modelgen.runtime.files.joined.joined_source import SEPARATOR, open_record, paths_of
from modelgen.runtime.files.source import Columns, Source
from modelgen.runtime.files.timestamps import counter_said, gone_on
from modelgen.runtime.files.units import unit_from_text
from modelgen.runtime.records.channel_checks import zero_faults
from modelgen.runtime.records.faults import Finding, clock_faults, reading_faults, time_faults
from modelgen.runtime.records.mapping_file import Proposed, mapping_text
from modelgen.runtime.records.propose_mapping import propose
from modelgen.runtime.records.read_record import read
from modelgen.runtime.records.sampling_frequency import PER_SECOND, UNITS, likely_unit

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model

Description = dict[str, Any]
MOST_TRIES = 200  # to find out which columns of a damaged file can be read
MOST_LINES = 40  # of a table on a terminal; the proposal and --json hold everything
EVEN = 0.01  # steps of a column of times that has no name differ by less; rounded times do by some
WIDEST = 60  # characters of a name in a table


def describe_file(path: Path, model: Model | None) -> Description:
    """Return columns, findings, and a proposed mapping of a data file as plain values.

    Raises
    ------
    DataError
        When the file cannot be read, or holds no numbers.
    """
    source = open_record(path)
    if not source.names:
        said = f" ({'; '.join(source.took)})" if source.took else ""
        remedy = (
            "save channels as vectors of numbers; of an object such as a timeseries ts, ts.Time and ts.Data"
        )
        raise DataError.at(str(path), f"holds no column of numbers{said}", remedy)
    source_load = source.load
    loaded = _loaded(source)
    source = replace(source, load=lambda names: _again(source_load, loaded, names))
    columns = {name: values.astype(float) for name, values in loaded.items() if values.dtype.kind in "iuf"}
    has_clocks = bool(source.clocks)
    if source.clock is None and source.fs is None:
        channels = [entry.column for entry in propose(source, model) if entry.column is not None]
        if times := _rising(columns, channels):
            said = f"{times} is taken as the column of times, as it rises evenly: check it"
            timed = {name: times for name in source.names if name != times}
            source = replace(source, clocks=timed, took=(*source.took, said))
    clocks = {source.clock, *source.clocks.values()} & columns.keys()
    on = {name: gone_on(columns[name]) for name in columns if name in clocks}
    full = [said for name in on for said in counter_said(name, columns[name], on[name])]
    source = replace(source, took=(*source.took, *full))
    still = [name for name, values in columns.items() if values.size and np.ptp(values) == 0.0]
    proposed = with_reversed(propose(source, model, still), model, columns)
    factor, unit = _time_unit(source, columns)
    findings = _findings(source, columns, proposed, factor)
    problems = _would_fail(source, proposed, findings, unit if source.clock else None)
    problems += _still_problems(path, proposed, still)
    return {
        "file": str(path),
        "took": list(source.took),
        "time": source.clock,
        "time_unit": unit if source.clock else None,
        "fs_hz": source.fs,
        "columns": [_describe(source, name, columns.get(name)) for name in source.names],
        "scalars": dict(source.scalars),
        "findings": [vars(finding) for finding in findings],
        "problems": problems,
        "channels": [vars(entry) for entry in proposed],
        "mapping": mapping_text(
            SEPARATOR.join(one.name for one in paths_of(path)),
            proposed,
            # where channels have times of their own, naming one column would give it to all of them
            None if has_clocks else source.clock,
            unit,
            source.fs if source.clock is None else None,
            tuple(finding.kind for finding in findings),
        ),
    }


def _loaded(source: Source) -> Columns:
    """Return every column that can be read; one that cannot is listed without numbers."""
    try:
        return source.load(source.names)
    except DeadlyFileError:
        raise
    except DataError:
        found = source.load_numeric(source.names) if source.load_numeric else _one_by_one(source)
        if found and not any(column.size for column in found.values()):
            raise  # there is nothing to describe
        return found


def _again(load: Callable[[Sequence[str]], Columns], loaded: Columns, names: Sequence[str]) -> Columns:
    """Return columns that have been read, without reading the file once more for them."""
    return {name: loaded[name] for name in names} if all(name in loaded for name in names) else load(names)


def _one_by_one(source: Source) -> Columns:
    """Return the columns that can be read, where not all can: halves of them, and halves of those."""
    found: Columns = {}
    left, tries = [source.names], 0
    while left and tries < MOST_TRIES:
        names, tries = left.pop(), tries + 1
        half = (len(names) + 1) // 2
        try:
            found.update(source.load(names))
        except DataError:
            left += [part for part in (names[half:], names[:half]) if len(names) > 1 and part]
    return found


def _describe(source: Source, name: str, values: Any) -> Description:
    unit = unit_from_text(source.units.get(name, ""))
    numbers = values is not None and values.size > 0
    there = values[np.isfinite(values)] if numbers else np.empty(0)
    return {
        "column": name,
        "unit": source.units.get(name) or None,
        "si_unit": unit.si if unit else None,
        "factor": unit.factor if unit else None,
        "times": source.clocks.get(name, source.clock),
        "samples": int(values.size) if numbers else 0,
        "minimum": float(np.min(there)) if there.size else None,
        "maximum": float(np.max(there)) if there.size else None,
        "first": float(values[0]) if numbers else None,
    }


def _rising(columns: Columns, channels: Sequence[str]) -> str | None:
    """Return the column that rises by equal steps, if one does; steps of 1 may count samples.

    Of several it is the one in the structure or group of all channels, "run1.t" of "run1.q_m".
    """
    found = []
    for name, values in columns.items():
        steps = np.diff(values)
        if steps.size > 1 and 0.0 < steps.min() != 1.0 and np.ptp(steps) <= EVEN * steps.min():
            found.append(name)
    if len(found) > 1 and len(groups := {name.rpartition(".")[0] for name in channels}) == 1:
        found = [name for name in found if name.rpartition(".")[0] in groups]
    return found[0] if len(found) == 1 else None


def _time_unit(source: Source, columns: dict[str, Any]) -> tuple[float, str]:
    """Return the factor to s and the name of the unit of times; guessed from the step if none is stated."""
    if source.clock is None:
        return 1.0, "s"
    unit = unit_from_text(source.units.get(source.clock, ""))
    if unit is not None and unit.si == "s":
        return unit.factor, source.units[source.clock]
    values = columns.get(source.clock)
    if values is None or values.size < 2:
        return 1.0, "s"
    step = abs(float(np.median(np.diff(values))))
    if source.fs is None:
        name = likely_unit(step, float(values[0]))
        return 1.0 / PER_SECOND[name], name
    # what agrees with the frequency that is stated
    for name, per_second in UNITS.items():
        if step > 0.0 and abs(1.0 / (step * source.fs) * per_second - 1.0) < 0.01:
            return 1.0 / per_second, name
    return 1.0, "s"


def _findings(
    source: Source, columns: dict[str, Any], proposed: tuple[Proposed, ...], factor: float
) -> tuple[Finding, ...]:
    clocks = dict.fromkeys([*source.clocks.values(), *([source.clock] if source.clock else [])])
    times = {name: gone_on(columns[name]) * factor for name in clocks if name in columns}
    findings = [finding for name, column in times.items() for finding in time_faults(name, column)]
    used = {entry.key: entry.column for entry in proposed if entry.column in columns}
    own = {
        key: times[source.clocks[column]]
        for key, column in used.items()
        if column in source.clocks and source.clocks[column] in times
    }
    if len(own) > 1:
        findings += clock_faults(own)
    signals, units = {}, {}
    for entry in proposed:
        if entry.key not in used:
            continue
        unit = unit_from_text(entry.stated or "")
        signals[entry.key] = columns[str(entry.column)] * (unit.factor if unit else 1.0)
        units[entry.key] = unit.si if unit else entry.unit
    return (*findings, *reading_faults(signals, units), *zero_faults(signals, units))


def _would_fail(
    source: Source, proposed: tuple[Proposed, ...], findings: tuple[Finding, ...], time_unit: str | None
) -> list[str]:
    """Return what reading the file with the proposed mapping would stop at, findings aside."""
    mapping = {entry.key: entry.column for entry in proposed if entry.column is not None}
    if not mapping or any(not finding.kind.startswith("offset") for finding in findings):
        return []
    try:
        read(source, mapping, time_unit=time_unit)
    except DataError as error:
        return [str(problem) for problem in error.problems]
    return []


def _still_problems(path: Path, proposed: tuple[Proposed, ...], still: Sequence[str]) -> list[str]:
    """Return one problem per proposed column that never changes."""
    remedy = "check its cable and its scale; it is right only if nothing moves or acts there"
    return [
        str(Problem(f"{path}: column {entry.column}", "has one number in every sample", remedy))
        for entry in proposed
        if entry.column in still
    ]


def import_lines(described: Description, written: Path | None, module: Path | None) -> list[str]:
    """Format the result of `describe_file` as lines of text."""
    lines = [described["file"], *_some([f"  took: {text}" for text in described["took"]]), ""]
    rows = [["column", "unit", "to SI", "samples", "from", "to", "first"]]
    chosen = {entry["column"] for entry in described["channels"][:MOST_LINES]} | {described["time"]}
    columns = described["columns"]
    shown = [entry for k, entry in enumerate(columns) if k < MOST_LINES or entry["column"] in chosen]
    for entry in shown:
        factor = "" if entry["factor"] is None else f"{entry['factor']:.6g} {entry['si_unit']}"
        numbers = [_number(entry[key]) for key in ("minimum", "maximum", "first")]
        named = [shortened(entry[key] or "", WIDEST) for key in ("column", "unit")]
        rows.append([*named, factor, str(entry["samples"]), *numbers])
    lines += aligned(rows)
    if len(shown) < len(columns):
        lines.append(f"and {len(columns) - len(shown)} more columns: --json lists them all")
    lines.append("")
    clock = described["time"]
    if clock:
        lines.append(f"times: column {clock} in {described['time_unit']}")
    elif described["fs_hz"]:
        lines.append(f"times: none, sampled at {described['fs_hz']:.9g} Hz")
    else:
        lines.append("times: none found; give --fs or --time to identify")
    findings = described["findings"]
    lines += _some([f"found: {finding['what']} (mend with --mend {finding['kind']})" for finding in findings])
    lines += _some([f"problem: {text}" for text in described["problems"]])
    lines.append("")
    lines += _some(
        [f"{entry['key']} <- {_taken(entry)}  ({entry['why']})" for entry in described["channels"]]
    )
    if written is not None:
        missing = [entry["key"] for entry in described["channels"] if entry["column"] is None]
        steps = ["check it", *([f"name the column of {listed(missing)} there"] if missing else [])]
        factors = [entry["key"] for entry in described["channels"] if Proposed(**entry).lacks_factor]
        steps += [f"write the factor of {listed(factors)} there"] if factors else []
        steps += ["set right what is a problem"] if described["problems"] else []
        lines += ["", f"wrote {written}: {', '.join(steps)}, then"]
        data, model, mapping = (
            shlex.quote(str(path)) for path in (described["file"], module or "MODULE.py", written)
        )
        lines.append(f"  modelgen identify {data} --model {model} --map-file {mapping} --report report.html")
    return [visible(line) for line in lines]  # a name with line breaks is one line


def _taken(entry: Description) -> str:
    """Return the column of a channel as --map takes it."""
    return f"{'-' if entry['negate'] else ''}{entry['column'] or 'no column fits'}"


def _some(lines: list[str]) -> list[str]:
    """Return the first lines, and how many more there are."""
    return lines if len(lines) <= MOST_LINES else [*lines[:MOST_LINES], f"and {len(lines) - MOST_LINES} more"]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"
