"""Parquet tables (.parquet) -> Source; needs pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modelgen.runtime.files.optional_reader import reader_library, unreadable
from modelgen.runtime.files.size_limits import check_expansion
from modelgen.runtime.files.source import Columns, Source, column_of_title, is_time_name
from modelgen.runtime.files.timestamps import elapsed_s


def open_parquet(path: Path) -> Source:
    """Return the source of a Parquet table; a field's metadata or its name may state a unit.

    A missing value becomes NaN, which a record refuses; time stamps become s since the first.

    Raises
    ------
    DataError
        When pyarrow is missing, the file is none, or it unpacks to far more than its size.
    """
    parquet = reader_library("pyarrow.parquet", path)
    try:
        schema = list(parquet.read_schema(path))
        rows = parquet.read_metadata(path).num_rows
    except Exception as error:  # the library's own exceptions derive from several built-in ones
        raise unreadable(path, "Parquet file", error) from error
    check_expansion(path, 8 * rows * len(schema))
    fields: dict[str, str] = {}
    units: dict[str, str] = {}
    stamps = []
    for field in schema:
        name, unit = column_of_title(str(path), field.name, fields)
        if str(field.type).startswith(("timestamp", "duration")):
            stamps.append(name)
            unit = "s"
        fields[name] = field.name
        stated = (field.metadata or {}).get(b"unit")
        unit = stated.decode() if stated else unit
        if unit:
            units[name] = unit
    # pandas stores an index of times under a name of its own
    named = any(is_time_name(name) for name in fields)
    clocks = {name: stamps[0] for name in fields if name not in stamps} if stamps and not named else {}

    def load(names: Sequence[str]) -> Columns:
        try:
            table = parquet.read_table(path, columns=[fields[name] for name in names])
        except Exception as error:
            raise unreadable(path, "Parquet file", error) from error
        return {name: elapsed_s(np.asarray(table.column(fields[name]).to_numpy())) for name in names}

    dates = dict.fromkeys(stamps)
    return Source(path, tuple(fields), load, units=units, clocks=clocks, starts=dates)
