"""Files of LabVIEW (.tdms) -> Source; needs npTDMS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.optional_reader import kept_log, reader_library, unreadable
from modelgen.runtime.files.size_limits import check_columns, check_expansion
from modelgen.runtime.files.source import Columns, Source, is_time_name

# step in s; start in ns since 1970, where it is stated, and s after it
_Waveform = tuple[float, int | None, float]
UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")


def open_tdms(path: Path) -> Source:
    """Return the source of a TDMS file: one column a channel; waveforms say when they were read.

    Raises
    ------
    DataError
        When npTDMS is missing, the file is none, or it states far more samples than it holds.
    """
    nptdms = reader_library("nptdms", path)
    columns: Columns = {}
    units: dict[str, str] = {}
    sampled: dict[str, _Waveform] = {}
    with kept_log("nptdms") as said:
        try:
            stated = nptdms.TdmsFile.read_metadata(path)
            check_expansion(path, 8 * sum(len(c) for group in stated.groups() for c in group.channels()))
            file = nptdms.TdmsFile.read(path)
        except (OSError, DataError):
            raise
        except Exception as error:  # the parser breaks in many ways on a file that is none
            raise unreadable(path, "TDMS file", error) from error
    for group in file.groups():
        for channel in group.channels():
            check_columns(path, len(columns))
            values = np.asarray(channel[:])
            if values.dtype.kind not in "iuf":
                continue
            name = channel.name if channel.name not in columns else f"{group.name}.{channel.name}"
            columns[name] = values
            stated = [str(channel.properties.get(key, "")).strip() for key in UNIT_PROPERTIES]
            units[name] = next(filter(None, stated), "")
            step = channel.properties.get("wf_increment")
            if isinstance(step, (int, float)) and isfinite(step) and step != 0.0:
                sampled[name] = float(step), *_start(channel.properties)

    def load(names: Sequence[str]) -> Columns:
        return {name: columns[name] for name in names}

    kinds = list(dict.fromkeys(sampled.values()))
    has_clock = any(is_time_name(name) for name in columns)
    fs = 1.0 / kinds[0][0] if len(kinds) == 1 and not has_clock else None
    took = f"a TDMS file, {fs:.9g} Hz by the waveform's increment" if fs else "a TDMS file"
    damaged = tuple(f"the file is damaged or was cut short: {message}" for message in said)
    clocks = {} if has_clock or len(kinds) < 2 else _clocks(columns, sampled)
    units |= dict.fromkeys(clocks.values(), "s")
    return Source(path, tuple(columns), load, fs=fs, units=units, clocks=clocks, took=(took, *damaged))


def _start(properties: Mapping[str, Any]) -> tuple[int | None, float]:
    """Return when a waveform starts: ns since 1970, if it says so, and s after that."""
    trigger, offset = properties.get("wf_start_time"), properties.get("wf_start_offset")
    after = float(offset) if isinstance(offset, (int, float)) and isfinite(offset) else 0.0
    if not isinstance(trigger, np.datetime64) or np.isnat(trigger):
        return None, after
    return int(trigger.astype("datetime64[ns]").astype(int)), after


def _clocks(columns: Columns, sampled: Mapping[str, _Waveform]) -> dict[str, str]:
    """Add a column of times in s for each kind of waveform, and return that of every channel.

    What states no date is taken to start with the first that does.
    """
    first = min((trigger for _, trigger, _ in sampled.values() if trigger is not None), default=0)
    names: dict[tuple[float, int, float, int], str] = {}
    clocks = {}
    for channel, (step, trigger, after) in sampled.items():
        count = columns[channel].size
        since = 0 if trigger is None else trigger - first
        name = names.setdefault((step, since, after, count), f"time ({len(names) + 1})")
        columns[name] = 1e-9 * since + after + step * np.arange(count)
        clocks[channel] = name
    return clocks
