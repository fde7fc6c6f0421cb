"""The tables of a project file, as dataclasses whose fields are the keys.

spec = "axis.toml"                 # or model = "generated/axis_qm.py"
sensors = "qm"
[known]                            # parameters that are held
J_c = 1.0e-3
[data]                             # how the files are read
map_file = "run1.map.toml"
[identify]                         # options of `modelgen identify`
method = "iv"
[output]
report = "axis.report.html"
[[records]]                        # one estimate a table
date = 2026-01-31
files = ["run1.csv", "run2.csv"]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date as Date
from typing import Literal


@dataclass(frozen=True)
class RecordsTable:
    """[[records]]: files that one estimate is made from, and the date it stands for; tags by record.

    `sensors` are sensor sets by record, where the project has several and a file does not show it; `payloads`
    what an arm carries, RECORD=NAME, or NAME in all records.
    """

    files: tuple[str, ...]
    date: Date | None = None
    tags: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, str] = field(default_factory=dict)
    payloads: tuple[str, ...] = ()


@dataclass(frozen=True)
class DataTable:
    """[data]: columns, factors and times, in the words of `modelgen.read_record`; they precede `map_file`."""

    map_file: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float | str] = field(default_factory=dict)
    fs_hz: float | None = None
    time: str | None = None
    time_unit: str | None = None
    mend: tuple[str, ...] = ()
    directions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class IdentifyTable:
    """[identify]: the options of `modelgen identify`, by their names on the command line."""

    method: Literal["auto", "wls", "iv", "tls", "pham2002"] = "auto"
    cutoff_hz: float | None = None
    filter_order: int | None = None
    decimation: int | None = None
    direction_cutoff_hz: float | None = None
    drop: int | None = None
    delay: Mapping[str, float] | str | None = None
    held: tuple[str, ...] = ()
    residual_dof: Literal["r-c", "r-1"] = "r-c"
    keep: tuple[str, ...] = ()
    robust: Literal["huber"] | None = None
    bounds: Literal["physical"] | None = None
    rows: Literal["force", "power"] = "force"
    memory_limit_mb: float | None = None
    pairing: Literal["all", "pham2002"] = "all"
    prune_percent: float = 10.0
    period_s: float | Mapping[str, float] | str | None = None
    hold_out: float | tuple[str, ...] | None = None
    scan_cutoffs: tuple[float, ...] | Literal["auto"] | None = None


@dataclass(frozen=True)
class OutputTable:
    """[output]: files that are written, below the project's folder; None for what is not wanted."""

    estimate: str | None = None
    report: str | None = None
    history: str | None = None


@dataclass(frozen=True)
class ProjectTable:
    """The whole file."""

    records: tuple[RecordsTable, ...]
    spec: str | None = None
    sensors: str | tuple[str, ...] | None = None
    model: str | tuple[str, ...] | None = None
    name: str | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    data: DataTable = field(default_factory=DataTable)
    identify: IdentifyTable = field(default_factory=IdentifyTable)
    output: OutputTable = field(default_factory=OutputTable)
