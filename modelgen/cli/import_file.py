"""modelgen import: what a data file holds, what is wrong with it, and which column may be which channel."""

from __future__ import annotations

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.source import Source
from modelgen.runtime.files.units import unit_from_text
from modelgen.runtime.records.faults import Finding, clock_faults, time_faults, zero_faults
from modelgen.runtime.records.mapping_file import Proposed, mapping_text
from modelgen.runtime.records.propose_mapping import propose
from modelgen.runtime.records.read_record import read
from modelgen.runtime.records.sampling_frequency import UNITS_PER_SECOND

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model

Description = dict[str, Any]


def describe_file(path: Path, model: Model | None) -> Description:
    """Return columns, findings, and a proposed mapping of a data file as plain values.

    Raises
    ------
    DataError
        When the file cannot be read.
    """
    source = open_source(path)
    columns = _columns(source)
    proposed = propose(source, model)
    factor, unit = _time_unit(source, columns)
    findings = _findings(source, columns, proposed, factor)
    problems = _would_fail(path, proposed, findings)
    return {
        "file": str(path),
        "took": list(source.took),
        "time": source.clock,
        "time_unit": unit if source.clock else None,
        "fs_hz": source.fs,
        "columns": [_describe(source, name, columns.get(name)) for name in source.names],
        "scalars": dict(source.scalars),
        "findings": [asdict(finding) for finding in findings],
        "problems": problems,
        "channels": [asdict(entry) for entry in proposed],
        "mapping": mapping_text(
            path.name,
            proposed,
            # where channels have times of their own, naming one column would give it to all of them
            None if source.clocks else source.clock,
            unit,
            source.fs if source.clock is None else None,
            tuple(finding.kind for finding in findings),
        ),
    }


def _columns(source: Source) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Return every column that holds numbers; one that does not is listed without them."""
    found = {}
    try:
        found = source.load(source.names)
    except DataError:
        for name in source.names:
            try:
                found.update(source.load((name,)))
            except DataError:
                continue
    return {name: values.astype(float) for name, values in found.items() if values.dtype.kind in "iuf"}


def _describe(source: Source, name: str, values: Any) -> Description:
    unit = unit_from_text(source.units.get(name, ""))
    numbers = values is not None and values.size > 0
    return {
        "column": name,
        "unit": source.units.get(name),
        "si_unit": unit.si if unit else None,
        "factor": unit.factor if unit else None,
        "times": source.clocks.get(name, source.clock),
        "samples": int(values.size) if numbers else 0,
        "minimum": float(np.min(values)) if numbers else None,
        "maximum": float(np.max(values)) if numbers else None,
        "first": float(values[0]) if numbers else None,
    }


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
    names = ("s", "ms", "us", "ns")
    # the coarsest unit in which a sample takes less than 50 ms, or that agrees with what is stated
    for per_second, name in zip(UNITS_PER_SECOND, names, strict=True):
        if source.fs is not None and abs(1.0 / (step * source.fs) * per_second - 1.0) < 0.01:
            return 1.0 / per_second, name
        if source.fs is None and 0.0 < step / per_second < 0.05:
            return 1.0 / per_second, name
    return 1.0, "s"


def _findings(
    source: Source, columns: dict[str, Any], proposed: tuple[Proposed, ...], factor: float
) -> tuple[Finding, ...]:
    clocks = dict.fromkeys([*source.clocks.values(), *([source.clock] if source.clock else [])])
    times = {name: columns[name] * factor for name in clocks if name in columns}
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
    return (*findings, *zero_faults(signals, units))


def _would_fail(path: Path, proposed: tuple[Proposed, ...], findings: tuple[Finding, ...]) -> list[str]:
    """Return what reading the file with the proposed mapping would stop at, findings aside."""
    mapping = {entry.key: entry.column for entry in proposed if entry.column is not None}
    if not mapping or any(not finding.kind.startswith("offset") for finding in findings):
        return []
    try:
        read(path, mapping)
    except DataError as error:
        return [str(problem) for problem in error.problems]
    return []


def import_lines(described: Description, written: Path | None, module: Path | None) -> list[str]:
    """Lay out what `describe_file` says as lines of text."""
    lines = [described["file"], *(f"  took: {text}" for text in described["took"]), ""]
    rows = [("column", "unit", "to SI", "samples", "from", "to", "first")]
    for entry in described["columns"]:
        factor = "" if entry["factor"] is None else f"{entry['factor']:.6g} {entry['si_unit']}"
        numbers = [_number(entry[key]) for key in ("minimum", "maximum", "first")]
        rows.append((entry["column"], entry["unit"] or "", factor, str(entry["samples"]), *numbers))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        lines.append("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
    lines.append("")
    clock = described["time"]
    if clock:
        lines.append(f"times: column {clock} in {described['time_unit']}")
    elif described["fs_hz"]:
        lines.append(f"times: none, sampled at {described['fs_hz']:.9g} Hz")
    else:
        lines.append("times: none found; give --fs or --time to identify")
    findings = described["findings"]
    lines += [f"found: {finding['what']} (mend with --mend {finding['kind']})" for finding in findings]
    lines += [f"problem: {text}" for text in described["problems"]]
    lines.append("")
    for entry in described["channels"]:
        lines.append(f"{entry['key']} <- {entry['column'] or 'no column fits'}  ({entry['why']})")
    if written is not None:
        lines += ["", f"wrote {written}: check it, then"]
        data, model, mapping = (
            shlex.quote(str(path)) for path in (described["file"], module or "MODULE.py", written)
        )
        lines.append(f"  modelgen identify {data} --model {model} --map-file {mapping} --report report.html")
    return lines


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"
