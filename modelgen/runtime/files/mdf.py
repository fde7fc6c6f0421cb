"""Measurement data files of ASAM (.mf4, .mdf, .dat) -> Source; needs asammdf."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.files.library_log import kept_log
from modelgen.runtime.files.optional_reader import reader_library, unreadable
from modelgen.runtime.files.size_limits import check_expansion
from modelgen.runtime.files.source import Columns, Source


def open_mdf(path: Path) -> Source:
    """Return the source of an MDF file: one column a channel, one column of times a channel group.

    Raises
    ------
    DataError
        When asammdf is missing, the file is none, or it unpacks to far more than its size.
    """
    asammdf = reader_library("asammdf", path)
    if not path.is_file():
        path.open("rb").close()
    signals: dict[str, tuple[int, Any]] = {}
    refused: DataError | None = None
    with kept_log("asammdf"):
        try:
            with asammdf.MDF(str(path)) as file:
                check_expansion(path, sum(map(_unpacked, file.groups)))
                for group in range(len(file.groups)):
                    for signal in _signals(file, group):
                        name = signal.name if signal.name not in signals else f"{signal.name} ({group})"
                        signals[name] = (group, signal)
        except DataError as error:
            refused = error
        except Exception as error:  # the parser breaks in many ways on a file that is none
            refused = unreadable(path, "MDF file", error)
            error.__traceback__ = None  # it holds a file half opened, which complains as it is deleted: now
            gc.collect()
    if refused is not None:
        raise refused
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


def _unpacked(group: Any) -> int:
    """Return how many bytes the samples of a channel group take, as the file states it."""
    stated = group.channel_group
    return int(stated.cycles_nr) * int(getattr(stated, "samples_byte_nr", 8) or 8)


def _signals(file: Any, group: int) -> list[Any]:
    """Return the numeric channels of a group, its column of times left out."""
    channels = file.groups[group].channels
    masters = file.masters_db
    wanted = [index for index in range(len(channels)) if index != masters.get(group)]
    found = [file.get(group=group, index=index) for index in wanted]
    return [signal for signal in found if np.asarray(signal.samples).dtype.kind in "iuf"]
