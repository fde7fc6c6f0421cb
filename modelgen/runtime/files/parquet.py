"""Parquet tables (.parquet) -> Source; needs pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem, shortened
from modelgen.runtime.files.optional_reader import reader_library, unreadable
from modelgen.runtime.files.size_limits import check_expansion
from modelgen.runtime.files.source import Columns, Source, columns_of_titles, is_time_name
from modelgen.runtime.files.timestamps import elapsed_s


def open_parquet(path: Path) -> Source:
    """Return the source of a Parquet table; a field's metadata or its name may state a unit.

    A missing value becomes NaN, which a record refuses; time stamps become s since the first. Texts, lists
    and structures are listed, and never read: a few bytes can stand for gigabytes of them.

    Raises
    ------
    DataError
        When pyarrow is missing, the file is none, or it unpacks to far more than its size.
    """
    parquet = reader_library("pyarrow.parquet", path)
    arrow = reader_library("pyarrow", path)
    try:
        stated = parquet.read_metadata(path)
        schema = list(stated.schema.to_arrow_schema())
        # the rows that are read are those of the groups, whatever the file states of their sum
        rows = sum(stated.row_group(group).num_rows for group in range(stated.num_row_groups))
    except Exception as error:  # the library's own exceptions derive from several built-in ones
        raise unreadable(path, "Parquet file", error) from error
    check_expansion(path, 8 * max(rows, stated.num_rows) * len(schema))
    kinds: dict[str, Any] = {}
    fields: dict[str, str] = {}
    units: dict[str, str] = {}
    stamps = []
    titles = columns_of_titles(str(path), [field.name for field in schema])
    for field, (name, unit) in zip(schema, titles, strict=True):
        if str(field.type).startswith(("timestamp", "duration")):
            stamps.append(name)
            unit = "s"
        fields[name], kinds[name] = field.name, field.type
        written = (field.metadata or {}).get(b"unit")
        unit = written.decode(errors="backslashreplace") if written else unit
        if unit:
            units[name] = unit
    # pandas stores an index of times under a name of its own
    named = any(is_time_name(name) for name in fields)
    clocks = {name: stamps[0] for name in fields if name not in stamps} if stamps and not named else {}

    def load_numeric(names: Sequence[str]) -> Columns:
        numeric = [name for name in names if _is_number(arrow, kinds[name])]
        try:
            table = parquet.read_table(path, columns=[fields[name] for name in numeric])
        except Exception as error:
            raise unreadable(path, "Parquet file", error) from error
        return {name: elapsed_s(_samples(arrow, table.column(fields[name]))) for name in numeric}

    def load(names: Sequence[str]) -> Columns:
        remedy = "write numbers into it, one a row, or name another column"
        DataError.raise_any(
            [
                Problem(f"{path}: column {name}", f"is of type {shortened(str(kinds[name]))}", remedy)
                for name in names
                if not _is_number(arrow, kinds[name])
            ]
        )
        return load_numeric(names)

    dates = dict.fromkeys(stamps)
    known = tuple(fields)
    return Source(path, known, load, units=units, clocks=clocks, starts=dates, load_numeric=load_numeric)


def _is_number(arrow: Any, kind: Any) -> bool:
    """Return whether a field of this type has one number, or one instant, a row."""
    kind = kind.value_type if arrow.types.is_dictionary(kind) else kind
    return any(
        is_kind(kind) for is_kind in (arrow.types.is_primitive, arrow.types.is_decimal, arrow.types.is_null)
    )


def _samples(arrow: Any, column: Any) -> npt.NDArray[Any]:
    """Return a column's samples, shape (n,), in its unit; decimal numbers of a database are floats."""
    numbers = column.cast(arrow.float64()) if arrow.types.is_decimal(column.type) else column
    return np.asarray(numbers.to_numpy())
