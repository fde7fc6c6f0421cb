"""Measurement data files of ASAM (.mf4, .mdf, .dat) -> Source; needs asammdf."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.runtime.missing_reader import reader_library, unreadable
from modelgen.runtime.source import Columns, Source


def open_mdf(path: Path) -> Source:
    """Return the source of an MDF file: one column a channel, one column of times a channel group.

    Raises
    ------
    DataError
        When asammdf is missing or the file is none.
    """
    asammdf = reader_library("asammdf", path)
    if not path.is_file():
        path.open("rb").close()
    try:
        with asammdf.MDF(str(path)) as file:
            signals = {}
            for group in range(len(file.groups)):
                for signal in _signals(file, group):
                    signals[signal.name if signal.name not in signals else f"{signal.name} ({group})"] = (
                        group,
                        signal,
                    )
    except Exception as error:  # the parser breaks in many ways on a file that is none
        raise unreadable(path, "MDF file", error) from error
    columns: Columns = {}
    clocks: dict[str, str] = {}
    units: dict[str, str] = {}
    times: dict[int, str] = {}
    for name, (group, signal) in signals.items():
        if group not in times:
            times[group] = "time" if not times else f"time ({len(times) + 1})"
            columns[times[group]] = np.asarray(signal.timestamps)
            units[times[group]] = "s"
        columns[name] = np.asarray(signal.samples)
        clocks[name] = times[group]
        if signal.unit:
            units[name] = signal.unit

    def load(names: Sequence[str]) -> Columns:
        return {name: columns[name] for name in names}

    took = (f"an MDF file of {len(times)} channel group(s), times in s",)
    several = clocks if len(times) > 1 else {}
    return Source(path, tuple(columns), load, units=units, clocks=several, took=took)


def _signals(file: Any, group: int) -> list[Any]:
    """Return the numeric channels of a group, its column of times left out."""
    channels = file.groups[group].channels
    masters = file.masters_db
    wanted = [index for index in range(len(channels)) if index != masters.get(group)]
    found = [file.get(group=group, index=index) for index in wanted]
    return [signal for signal in found if np.asarray(signal.samples).dtype.kind in "iuf"]
