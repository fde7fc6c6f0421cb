"""Parquet tables: what of their fields is read, and what a few bytes could make of memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.cli.import_file import describe_file
from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read_record

arrow: Any = pytest.importorskip("pyarrow")
parquet: Any = pytest.importorskip("pyarrow.parquet")
N = 20
T = np.arange(N) / 100.0


def varint(number: int) -> bytes:
    """Return a signed number as Parquet's footer holds it, in five bytes whatever its size."""
    zigzag = 2 * number
    digits = [(zigzag >> 7 * place) & 127 for place in range(5)]
    return bytes([*(digit | 128 for digit in digits[:-1]), digits[-1]])


def test_decimal_and_repeated_numbers_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    decimal = arrow.array([0.25 * k for k in range(N)]).cast(arrow.decimal128(10, 2))
    repeated = arrow.array([1.5, 2.5] * (N // 2)).dictionary_encode()
    parquet.write_table(arrow.table({"t": T, "q": decimal, "F": repeated}), path)
    record = read_record(path)
    np.testing.assert_array_equal(record.signals["q"], 0.25 * np.arange(N))
    np.testing.assert_array_equal(record.signals["F"], [1.5, 2.5] * (N // 2))


def test_texts_and_lists_are_never_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.parquet"
    lists = arrow.array([[0.0] * 3] * N)
    parquet.write_table(arrow.table({"t": T, "q": T, "label": ["a"] * N, "lists": lists}), path)
    read: list[str] = []
    table = parquet.read_table

    def watched(path: Path, columns: list[str]) -> Any:
        read.extend(columns)
        return table(path, columns=columns)

    monkeypatch.setattr(parquet, "read_table", watched)
    described = describe_file(path, None)
    assert {column["column"]: column["samples"] for column in described["columns"]} == {
        "t": N,
        "q": N,
        "label": 0,
        "lists": 0,
    }
    for column, kind in (("label", "string"), ("lists", "list<element: double>")):
        with pytest.raises(DataError, match=f"column {column}: is of type {kind}; write numbers into it"):
            read_record(path, {"q": column}, fs=100.0)
    assert set(read) == {"t", "q"}


def test_rows_are_counted_in_their_groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, n = tmp_path / "run.parquet", 2**27 + 1  # a number that takes five bytes
    monkeypatch.setattr("modelgen.runtime.files.size_limits.ALWAYS_FINE", 1_000_000)
    parquet.write_table(arrow.table({"q": np.zeros(n, dtype=np.int8)}), path, row_group_size=n)
    content = path.read_bytes()
    start = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    place = content.index(varint(n), start)  # the first count in the footer is that of all rows
    path.write_bytes(content[:place] + varint(10) + content[place + 5 :])
    assert parquet.read_metadata(path).num_rows == 10
    with pytest.raises(DataError, match=r"unpacks from .* to 1073.*MB or more"):
        read_record(path, {"q": "q"}, fs=100.0)


def test_a_unit_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    field = arrow.field("q", arrow.float64(), metadata={b"unit": b"\xff"})
    parquet.write_table(arrow.Table.from_arrays([arrow.array(T)], schema=arrow.schema([field])), path)
    assert describe_file(path, None)["columns"][0]["unit"] == "\\xff"
