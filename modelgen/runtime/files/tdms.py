"""Files of LabVIEW (.tdms) -> Source; needs npTDMS."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.optional_reader import kept_log, reader_library, unreadable
from modelgen.runtime.files.size_limits import check_columns, check_expansion
from modelgen.runtime.files.source import Columns, Source, is_time_name


def open_tdms(path: Path) -> Source:
    """Return the source of a TDMS file: one column a channel; the waveform's increment gives the times.

    Raises
    ------
    DataError
        When npTDMS is missing, the file is none, or it states far more samples than it holds.
    """
    nptdms = reader_library("nptdms", path)
    columns: Columns = {}
    units: dict[str, str] = {}
    steps: dict[str, float] = {}
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
            unit = str(channel.properties.get("unit_string", "")).strip()
            if unit:
                units[name] = unit
            step = channel.properties.get("wf_increment")
            if isinstance(step, (int, float)) and isfinite(step) and step != 0.0:
                steps[name] = float(step)

    def load(names: Sequence[str]) -> Columns:
        return {name: columns[name] for name in names}

    distinct = sorted(dict.fromkeys(steps.values()))
    has_clock = any(is_time_name(name) for name in columns)
    fs = 1.0 / distinct[0] if len(distinct) == 1 and not has_clock else None
    took = f"a TDMS file, {fs:.9g} Hz by the waveform's increment" if fs else "a TDMS file"
    damaged = tuple(f"the file is damaged or was cut short: {message}" for message in said)
    return Source(path, tuple(columns), load, fs=fs, units=units, took=(took, *damaged))
