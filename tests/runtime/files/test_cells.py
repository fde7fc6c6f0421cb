"""Cells of a table of text: those without a reading, numbers in quotes, marks between thousands, days."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.cli.import_file import describe_file
from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.records.read_record import read

N = 40
T = np.arange(N) / 100.0
Q = 2.0 + np.sin(7.0 * T)


def table(folder: Path, cells: list[str], separator: str = ",", times: list[str] | None = None) -> Path:
    path = folder / "run.csv"
    stamps = times or [f"{t:.2f}" for t in T]
    rows = [f"{stamp}{separator}{cell}" for stamp, cell in zip(stamps, cells, strict=True)]
    path.write_text("\n".join([f"t{separator}q_m", *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("word", ["", "NaN", "NA", "#N/A", "#NV", "null", "---", "n. def."])
@pytest.mark.parametrize("place", [0, 7, N - 1])
def test_a_cell_without_a_reading_is_a_missing_one(tmp_path: Path, word: str, place: int) -> None:
    cells = [f"{q:.9f}" for q in Q]
    cells[place] = word
    path = table(tmp_path, cells)
    with pytest.raises(DataError, match=f"column q_m, sample {place}: is nan .*--mend gaps.*--mend fill"):
        read(path)
    filled = read(path, mend=("fill",)).record
    assert filled.n == (N if place == 7 else N - 1)
    described = describe_file(path, None)["columns"][1]
    assert (described["column"], described["samples"]) == ("q_m", N)
    assert described["minimum"] == pytest.approx(np.delete(Q, place).min(), abs=1e-8)


def test_other_words_are_mistakes(tmp_path: Path) -> None:
    cells = [f"{q:.9f}" for q in Q]
    cells[7] = "OVR"
    with pytest.raises(DataError, match="line 9, column q_m: is 'OVR', no number; correct the cell"):
        read(table(tmp_path, cells))


def test_a_decimal_comma_in_quotes(tmp_path: Path) -> None:
    decimal = [f'"{q:.9f}"'.replace(".", ",") for q in Q]
    path = table(tmp_path, decimal, times=[f'"{t:.2f}"'.replace(".", ",") for t in T])
    record = read(path).record
    np.testing.assert_allclose(record.signals["q_m"], Q, atol=1e-9)
    assert record.fs == 100.0


@pytest.mark.parametrize("thousands", ['"1,234"', '"1,234.5"', "1'234.5", "1 234.5"])
def test_thousands_are_not_taken_for_a_decimal_comma(tmp_path: Path, thousands: str) -> None:
    cells = [f"{q:.4f}" for q in Q]
    for place in (0, 20):
        cells[place] = thousands
    with pytest.raises(DataError, match=r"no number; write numbers without a mark between thousands"):
        read(table(tmp_path, cells))


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path: Path) -> None:
    path = table(tmp_path, [f"{q:.9f}" for q in Q], times=[f"{45356.625 + t / 86_400.0:.13f}" for t in T])
    with pytest.raises(DataError, match=r"as times in days do; give their unit \(--time-unit days"):
        read(path)
    assert read(path, time_unit="days").record.fs == pytest.approx(100.0, rel=1e-4)
    assert describe_file(path, None)["time_unit"] == "days"
    assert open_source(path).clock == "t"


@pytest.mark.parametrize("counts", ["1.015", "12.015.678", "-1.015"])
def test_points_between_thousands_of_whole_numbers_are_no_decimal_points(tmp_path: Path, counts: str) -> None:
    cells = [f"{k}" for k in range(N)]
    cells[30] = counts
    times = [f"{t:.2f}".replace(".", ",") for t in T]
    with pytest.raises(
        DataError, match=f"line 32, column q_m: is '{counts}', no number; write numbers without"
    ):
        read(table(tmp_path, cells, ";", times))
    plain = read(table(tmp_path, cells, ";")).record if counts.count(".") == 1 else None
    assert plain is None or plain.signals["q_m"][30] == float(counts)  # no comma says what a point is


def test_units_below_the_names_of_which_one_is_not_known(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{t:.2f};{q:.4f};{q:.4f};1".replace(".", ",") for t, q in zip(T, Q, strict=True)]
    path.write_text("\n".join(["Zeit;Winkel;Weg;Strom", "s;grad;mm;A", *rows]), encoding="utf-8")
    source = open_source(path)
    assert source.names == ("Zeit", "Winkel", "Weg", "Strom")
    assert source.units == {"Zeit": "s", "Winkel": "grad", "Weg": "mm", "Strom": "A"}


def test_a_unit_behind_a_comma(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{t:.2f};{q:.4f};1" for t, q in zip(T, Q, strict=True)]
    path.write_text("\n".join(["Time, ms;Motor pos., °;axis 1, left", *rows]), encoding="utf-8")
    source = open_source(path)
    assert source.names == ("Time", "Motor pos.", "axis 1, left")
    assert source.units == {"Time": "ms", "Motor pos.": "°"}
