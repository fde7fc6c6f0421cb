"""Columns of times as text, ISO 8601 or day first, to the nanosecond; what is wrong in them is reported."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.timestamps import gone_on, is_date, nanoseconds, time_since
from modelgen.runtime.records.dataframe import record_from_frame
from modelgen.runtime.records.read_record import read

N, STEP_US = 50, 250
START = datetime(2022, 5, 2, 15, 59, 59, 995_000, tzinfo=UTC)
MOMENTS = [START + timedelta(microseconds=STEP_US * k) for k in range(N)]
READINGS = np.sin(np.arange(N) / 7.0)

WAYS: dict[str, tuple[str, Callable[[datetime], str]]] = {
    "T": (",", lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%f")),
    "space": ("\t", lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f")),
    "zulu": (",", lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%fZ")),
    "offset": (";", lambda t: t.strftime("%Y-%m-%d %H:%M:%S,%f+02:00")),
    "day first": (";", lambda t: t.strftime("%d.%m.%Y %H:%M:%S,%f")),
    "slashes": (",", lambda t: t.strftime("%Y/%m/%d %H:%M:%S.%f")),
    "nanoseconds": (",", lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f000")),
    "quoted": (",", lambda t: t.strftime('"%Y-%m-%d %H:%M:%S.%f"')),
    "time of day": (",", lambda t: t.strftime("%H:%M:%S.%f")),
    "AM and PM": (",", lambda t: t.strftime("%m/%d/%Y %I:%M:%S.%f %p")),
    "small pm": (",", lambda t: t.strftime("%I:%M:%S.%f %p").lower()),
    "slashes, day first": (";", lambda t: t.strftime("%d/%m/%Y %H:%M:%S,%f")),
}


def table(folder: Path, separator: str, stamps: list[str], name: str = "Timestamp") -> Path:
    numbers = [f"{value:.9f}" for value in READINGS]
    if separator == ";":
        numbers = [text.replace(".", ",") for text in numbers]
    rows = [f"{stamp}{separator}{text}" for stamp, text in zip(stamps, numbers, strict=True)]
    path = folder / "log.csv"
    path.write_text("\n".join([f"{name}{separator}q_m", *rows]), encoding="utf-8")
    return path


@pytest.mark.parametrize("way", WAYS)
def test_stamps_become_seconds(tmp_path: Path, way: str) -> None:
    separator, text = WAYS[way]
    reading = read(table(tmp_path, separator, [text(moment) for moment in MOMENTS]))
    assert reading.record.fs == 1e6 / STEP_US
    np.testing.assert_allclose(reading.record.signals["q_m"], READINGS, atol=1e-9)
    assert reading.findings == ()
    assert any("Timestamp holds time stamps, counted from" in sentence for sentence in reading.took)


@pytest.mark.parametrize("way", ["time of day", "AM and PM", "small pm", "slashes, day first", "day first"])
def test_a_clock_goes_on_after_midnight_and_noon(tmp_path: Path, way: str) -> None:
    separator, text = WAYS[way]
    for hours in (4, 8, 20):
        late = [text(moment + timedelta(hours=hours)) for moment in MOMENTS]
        reading = read(table(tmp_path, separator, late))
        assert (reading.record.fs, reading.record.n, reading.findings) == (1e6 / STEP_US, N, ())


def test_of_numbers_between_slashes_one_is_the_month() -> None:
    for cell in ("05/03/2024 14:00:00", "03/05/2024 02:00:00 PM", "5/3/2024 14:00:00"):
        assert nanoseconds(cell) == nanoseconds("2024-03-05T14:00:00")
    for cell in ("03/25/2024 14:00:00", "25/03/2024 02:00:00 PM"):  # only one of them can be
        assert nanoseconds(cell) == nanoseconds("2024-03-25T14:00:00")
    assert nanoseconds("05/03/2024 13:00:00 PM") is None
    assert is_date("05/03/2024")


def test_a_column_of_stamps_is_the_clock_whatever_its_name(tmp_path: Path) -> None:
    stamps = [WAYS["T"][1](moment) for moment in MOMENTS]
    assert read(table(tmp_path, ",", stamps, name="logged at")).record.fs == 1e6 / STEP_US


def test_a_day_beside_the_time_is_left_out(tmp_path: Path) -> None:
    stamps = [moment.strftime("%d.%m.%Y;%H:%M:%S,%f") for moment in MOMENTS]
    reading = read(table(tmp_path, ";", stamps, name="Datum;Zeit"))
    assert list(reading.record.signals) == ["q_m"]
    assert reading.record.fs == 1e6 / STEP_US
    assert "column Datum holds days, left out" in reading.took


def test_gaps_between_stamps_are_found_with_their_size(tmp_path: Path) -> None:
    stamps = [WAYS["T"][1](moment + timedelta(seconds=2.0 * (k >= 20))) for k, moment in enumerate(MOMENTS)]
    path = table(tmp_path, ",", stamps)
    with pytest.raises(DataError, match="sample 20"):
        read(path)
    reading = read(path, mend=("gaps",))
    assert reading.record.n == 30
    assert "2.00025 s" in reading.findings[0].what


def test_a_stamp_that_is_none_is_located(tmp_path: Path) -> None:
    stamps = [WAYS["T"][1](moment) for moment in MOMENTS]
    stamps[30] = "2022-05-02T25:61:00.0"
    with pytest.raises(DataError, match=r"line 32, column Timestamp: is '2022-05-02T25:61:00\.0', no time"):
        read(table(tmp_path, ",", stamps))


@pytest.mark.parametrize(
    "text", ["", "12:30", "1.5", "2022-13-01 10:00:00", "2022-05-02", "13:00:00 PM", "1:2:3", "١٢:٠٠"]
)
def test_what_is_no_time_is_none(text: str) -> None:
    assert nanoseconds(text) is None


def test_single_stamps() -> None:
    assert nanoseconds("1970-01-01T00:00:01.000000001") == 1_000_000_001
    assert nanoseconds("1970-01-01T02:00:00+02:00") == 0
    assert nanoseconds("1969-12-31 23:00:00.25-01") == 250_000_000
    assert is_date("02.05.2022") and is_date("2022-05-02") and not is_date("2.5")
    assert time_since("23:59:59.5")("23:59:59.75") == 0.25


@pytest.mark.parametrize(("unit", "per_s"), [("ns", 10**9), ("100ns", 10**7)])
def test_counts_too_long_for_a_double_keep_their_digits(tmp_path: Path, unit: str, per_s: int) -> None:
    """Since 1970 in ns a double is 256 ns off, which would pass for an uneven clock."""
    step = STEP_US * per_s // 10**6
    first = 1_651_507_200 * per_s + 12_345_678_901 * (per_s < 10**9) * 10**7
    path = table(tmp_path, ",", [str(first + step * k) for k in range(N)], name=f"timestamp [{unit}]")
    reading = read(path)
    assert reading.record.fs == 1e6 / STEP_US
    assert reading.findings == ()


def test_a_number_of_thousands_of_digits_is_no_time(tmp_path: Path) -> None:
    with pytest.raises(DataError):
        read(table(tmp_path, ",", ["1" * 5000] * N, name="time"))


def test_columns_of_stamps_keep_how_far_they_are_apart(tmp_path: Path) -> None:
    late = timedelta(microseconds=100)
    rows = ["time,q_m,time,torque"]
    rows += [f"{m.isoformat()},{k},{(m + late).isoformat()},{k}" for k, m in enumerate(MOMENTS)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    with pytest.raises(DataError, match=r"torque starts 0\.0001 s after q_m"):
        read(path, {"q_m": "q_m", "torque": "torque"})


@pytest.mark.parametrize("unit", ["us", "ns"])
def test_stamps_of_a_table_of_pandas(tmp_path: Path, unit: str) -> None:
    index = pandas.DatetimeIndex(MOMENTS).as_unit(unit)
    frame = pandas.DataFrame({"q_m": READINGS}, index=index)
    frame.to_parquet(tmp_path / "log.parquet")
    column = frame.reset_index(names="logged at")
    column.to_parquet(tmp_path / "column.parquet", index=False)
    for record in (
        read(tmp_path / "log.parquet").record,
        read(tmp_path / "column.parquet").record,
        record_from_frame(frame),
        record_from_frame(column.rename(columns={"logged at": "time"})),
    ):
        assert record.fs == 1e6 / STEP_US
        assert list(record.signals) == ["q_m"]


@pytest.mark.parametrize("titles", [("q [rad]", "q [deg]"), ("q", "q [deg]"), ("q", "q")])
def test_two_columns_of_a_table_of_pandas_that_differ_by_their_unit_alone(
    titles: tuple[str, str], tmp_path: Path
) -> None:
    frame = pandas.DataFrame(np.arange(6.0).reshape(3, 2), columns=list(titles))
    if len(set(titles)) == 2:  # pandas writes no others
        frame.to_parquet(tmp_path / "a.parquet")
        with pytest.raises(DataError, match="two columns are named q; give every column its own name"):
            read(tmp_path / "a.parquet", fs=1.0)
    with pytest.raises(DataError, match="two columns are named q; give every column its own name"):
        record_from_frame(frame, fs=1.0)


def test_minutes_and_seconds_go_on_after_the_hour(tmp_path: Path) -> None:
    stamps = [f"{59 if k < 40 else 0:02d}:{59 if k < 40 else 0:02d},{(k % 40) * 25:03d}" for k in range(N)]
    reading = read(table(tmp_path, ";", stamps))
    assert reading.record.fs == pytest.approx(40.0)
    assert reading.findings == ()


def test_hours_and_minutes_alone_are_no_times(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="line 2, column Timestamp: is '12:30', no number; write times in s"):
        read(table(tmp_path, ",", ["12:30"] * N), time="Timestamp")


@pytest.mark.parametrize("bits", [16, 24, 31, 32])
def test_a_counter_that_is_full_goes_on(tmp_path: Path, bits: int) -> None:
    counts = (2**bits - 10_125 + 250 * np.arange(3 * N)) % 2**bits
    rows = [f"{count},{np.sin(k / 7.0):.9f}" for k, count in enumerate(counts)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t_us,q_m", *rows]))
    reading = read(path)
    assert (reading.record.fs, reading.record.n, reading.findings) == (4000.0, 3 * N, ())
    assert "t_us begins again, as a counter does that is full: it goes on" in reading.took


def test_times_that_fall_by_another_amount_are_not_taken_for_a_counter() -> None:
    for fall in (65_000, 2**16 + 400, 2**20):
        counts = np.r_[np.arange(200_000, 260_000, 100), np.arange(260_000, 261_000, 100) - fall].astype(
            float
        )
        assert gone_on(counts) is counts
