"""Calls of a reading process (`reader_child`) about an MDF file; only there is asammdf ever imported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import asammdf
import numpy as np

from modelgen.runtime.files.size_limits import MOST_COLUMNS


def listing(path: Path) -> Iterator[Any]:
    """Yield how many bytes the samples take and how many channels there are, then a list of the numeric
    ones, {"name", "group", "index", "unit"}, times left out; of too many channels nothing.
    """
    with asammdf.MDF(path) as file:
        yield sum(map(_unpacked, file.groups))
        count = sum(len(group.channels) for group in file.groups)
        yield count
        yield [] if count > MOST_COLUMNS else _numeric(file)


def _unpacked(group: Any) -> int:
    """Return how many bytes the samples of a channel group take, as the file states it."""
    stated = group.channel_group
    return int(stated.cycles_nr) * int(getattr(stated, "samples_byte_nr", 8) or 8)


def _numeric(file: Any) -> list[dict[str, Any]]:
    found = []
    for group, content in enumerate(file.groups):
        places = [index for index in range(len(content.channels)) if index != file.masters_db.get(group)]
        first = file.select([(None, group, index) for index in places], record_count=1) if places else []
        found += [
            {"name": signal.name, "group": group, "index": index, "unit": signal.unit}
            for index, signal in zip(places, first, strict=True)
            if np.asarray(signal.samples).dtype.kind in "iuf"
        ]
    return found


def columns(path: Path, places: Sequence[Sequence[int]], clocks: Sequence[int]) -> Iterator[Any]:
    """Yield the samples of channels, (group, index) each, then the times of channel groups."""
    with asammdf.MDF(path) as file:
        wanted = [(None, group, index) for group, index in places]
        for signal in file.select(wanted) if wanted else []:
            yield np.asarray(signal.samples)
        for group in clocks:
            yield np.asarray(file.get_master(group))


def lengths(path: Path, names: Sequence[str]) -> Iterator[Any]:
    """Yield the number of samples of each of these channels, None for one that is not there."""
    with asammdf.MDF(path) as file:
        for name in names:
            group = file.whereis(name)[0][0] if name in file else None
            yield None if group is None else int(file.groups[group].channel_group.cycles_nr)


def stretch(path: Path, name: str, start: int, stop: int) -> Iterator[Any]:
    """Yield samples start to stop of a channel."""
    with asammdf.MDF(path) as file:
        yield np.asarray(file.get(name, record_offset=start, record_count=stop - start).samples)
