"""pandas DataFrame -> Record, as a file of the same columns would be read; pandas itself is not imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.runtime.files.source import Columns, Source, columns_of_titles, is_time_name
from modelgen.runtime.files.timestamps import elapsed_s
from modelgen.runtime.files.units import split_name
from modelgen.runtime.records.read_record import read
from modelgen.runtime.records.record import Record


def record_from_frame(
    frame: Any,
    mapping: Mapping[str, str] | None = None,
    scales: Mapping[str, float | str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    name: str = "record",
    tag: str | None = None,
    mend: Sequence[str] = (),
) -> Record:
    """Return the record of a DataFrame's columns.

    Parameters
    ----------
    frame : pandas.DataFrame
        One column a channel; a title may state a unit, "theta [deg]". The times are a column, or the index if
        it is named so or holds time stamps or differences.
    mapping, scales, fs, time, name, tag, mend
        As in `modelgen.read_record`.

    Raises
    ------
    DataError
        As `modelgen.read_record` does.
    """
    columns: Columns = {}
    units: dict[str, str] = {}
    index = _index_seconds(frame.index)
    if index is not None and not any(is_time_name(split_name(str(title))[0]) for title in frame.columns):
        columns["time"] = index
        units["time"] = "s"
    titles = columns_of_titles(name, [*columns, *(str(title) for title in frame.columns)])[len(columns) :]
    for (_, cells), (column, unit) in zip(frame.items(), titles, strict=True):
        values = _values(cells)
        columns[column] = elapsed_s(values)
        if values.dtype.kind in "mM":
            units[column] = "s"
        elif unit:
            units[column] = unit

    def load(names: Sequence[str]) -> Columns:
        return {key: columns[key] for key in names}

    source = Source(Path(name), tuple(columns), load, units=units, name=name, tag=tag)
    return read(source, mapping, scales, fs, time, mend=mend).record


def _values(column: Any) -> np.ndarray[Any, np.dtype[Any]]:
    """Return a column or index; times with a zone would become objects."""
    zoned = getattr(column.dtype, "tz", None) is not None
    return np.asarray(column, dtype="datetime64[ns]" if zoned else None)


def _index_seconds(index: Any) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return the index as times in s, or None where it only counts rows."""
    values = _values(index)
    if values.dtype.kind in "mM":
        return elapsed_s(values)
    named = index.name is not None and is_time_name(str(index.name))
    return values.astype(float) if named and values.dtype.kind in "iuf" else None
