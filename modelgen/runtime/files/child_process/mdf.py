"""Measurement data files of ASAM (.mf4, .mdf, .dat) -> Source; needs asammdf."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from modelgen.runtime.files.child_process.reader_process import ask
from modelgen.runtime.files.size_limits import check_columns, check_expansion
from modelgen.runtime.files.source import Columns, Source


def open_mdf(path: Path) -> Source:
    """Return the source of an MDF file: one column a channel, one column of times a channel group.

    Raises
    ------
    DataError
        When asammdf is missing, the file is none, or it unpacks to far more than its size.
    """
    unpacked, count, channels = ask("mdf.listing", path)
    check_expansion(path, unpacked)
    check_columns(path, count)
    places: dict[str, tuple[int, int]] = {}
    clocks: dict[str, str] = {}
    units: dict[str, str] = {}
    times: dict[int, str] = {}
    names: dict[str, None] = {}
    for channel in channels:
        group, name = channel["group"], channel["name"]
        if group not in times:
            times[group] = "time" if not times else f"time ({len(times) + 1})"
            units[times[group]] = "s"
            names[times[group]] = None
        while name in names:
            name = f"{name} ({group})"
        names[name] = None
        places[name], clocks[name] = (group, channel["index"]), times[group]
        if channel["unit"]:
            units[name] = channel["unit"]
    group_of = {clock: group for group, clock in times.items()}

    def load(names: Sequence[str]) -> Columns:
        samples = [name for name in names if name in places]
        asked = [name for name in names if name in group_of]
        wanted, groups = [places[name] for name in samples], [group_of[name] for name in asked]
        read = ask("mdf.columns", path, places=wanted, clocks=groups)
        found = dict(zip((*samples, *asked), read, strict=True))
        return {name: found[name] for name in names}

    took = (f"an MDF file of {len(times)} channel group(s), times in s",)
    several = clocks if len(times) > 1 else {}
    return Source(path, tuple(names), load, units=units, clocks=several, took=took)
