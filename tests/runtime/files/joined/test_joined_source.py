"""One record in several files: together by their times, cut to what all have, interpolated if told."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.files.joined.joined_source import open_record, paths_of
from modelgen.runtime.records.read_record import read, read_record

STEP_S = 0.002


def table(path: Path, times: np.ndarray, name: str, values: np.ndarray, head: str = "t") -> Path:
    rows = zip(times.tolist(), values.tolist(), strict=True)
    path.write_text(f"{head},{name}\n" + "".join(f"{t!r},{v!r}\n" for t, v in rows), encoding="utf-8")
    return path


def motion(times: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(7.0 * times))


def together(*paths: Path) -> Path:
    return Path(",".join(map(str, paths)))


@settings(max_examples=25)
@given(
    first=st.tuples(st.integers(0, 40), st.integers(60, 200)),
    second=st.tuples(st.integers(0, 40), st.integers(60, 200)),
    in_ms=st.booleans(),
    origin=st.sampled_from([0.0, -3.0, 1.7e9]),
)
def test_loggers_of_one_clock_are_cut_to_what_both_have(
    tmp_path_factory: pytest.TempPathFactory,
    first: tuple[int, int],
    second: tuple[int, int],
    in_ms: bool,
    origin: float,
) -> None:
    folder = tmp_path_factory.mktemp("two")
    k, j = np.arange(*first), np.arange(*second)
    motor = table(folder / "motor.csv", origin + STEP_S * k, "theta", motion(STEP_S * k))
    times = (origin + STEP_S * j) * (1e3 if in_ms else 1.0)
    unit = " [ms]" if in_ms else " [s]"
    load = table(folder / "load.csv", times, "acc", motion(STEP_S * j), f"t{unit}")
    reading = read(together(motor, load), {"q_m": "theta", "a_c": "acc"})
    record, both = reading.record, np.arange(max(first[0], second[0]), min(first[1], second[1]))
    assert record.name == "motor"
    assert record.fs == pytest.approx(1.0 / STEP_S, rel=1e-4)
    for key in ("q_m", "a_c"):
        np.testing.assert_array_equal(record.signals[key], motion(STEP_S * both))
    assert bool(reading.mended) == (first != second)


def test_dates_of_two_loggers_are_counted_from_one_instant(tmp_path: Path) -> None:
    start = datetime(2024, 5, 2, 15, 56, 24, tzinfo=UTC)

    def stamped(name: str, column: str, late: int, count: int) -> Path:
        times = [start + timedelta(milliseconds=2 * (late + k)) for k in range(count)]
        rows = [f"{t.isoformat(timespec='milliseconds')},{late + k}" for k, t in enumerate(times)]
        (tmp_path / name).write_text("\n".join([f"time,{column}", *rows]), encoding="utf-8")
        return tmp_path / name

    path = together(stamped("a.csv", "q", 0, 50), stamped("b.csv", "i", 20, 50))
    record = read_record(path, {"q_m": "q", "F": "i"})
    np.testing.assert_array_equal(record.signals["q_m"], np.arange(20, 50))
    np.testing.assert_array_equal(record.signals["F"], np.arange(20, 50))
    numbers = table(tmp_path / "c.csv", np.arange(50) * 0.002, "x", np.arange(50.0), "time")
    with pytest.raises(DataError, match=r"c\.csv: does not say when its times begin, as those of a\.csv"):
        read_record(together(tmp_path / "a.csv", numbers))


def test_other_rates_are_interpolated_only_if_told(tmp_path: Path) -> None:
    fast, slow = np.arange(1000) * 1e-3, np.arange(100) * 1e-2
    path = together(
        table(tmp_path / "a.csv", fast, "q", motion(fast)), table(tmp_path / "b.csv", slow, "F", motion(slow))
    )
    with pytest.raises(DataError, match=r"steps by 0\.01 s against 0\.001.*--mend clocks"):
        read_record(path, {"q_m": "q", "F": "F"})
    reading = read(path, {"q_m": "q", "F": "F"}, mend=("clocks",))
    assert reading.record.fs == pytest.approx(1000.0)
    np.testing.assert_allclose(reading.record.signals["F"], reading.record.signals["q_m"], atol=1e-4)
    assert any("F interpolated to the times of q_m" in text for text in reading.mended)


def test_times_that_do_not_meet_are_refused(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    path = together(table(tmp_path / "a.csv", t, "q", t), table(tmp_path / "b.csv", t + 9.0, "F", t))
    with pytest.raises(DataError, match="starts 9 s after"):
        read_record(path, {"q_m": "q", "F": "F"})
    with pytest.raises(DataError, match="do not overlap"):
        read_record(path, {"q_m": "q", "F": "F"}, mend=("clocks",))


def test_a_file_without_times_is_named_and_one_can_be_named(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    a = table(tmp_path / "a.csv", t, "q", motion(t))
    b = table(tmp_path / "b.csv", t, "F", motion(t), head="stamp")
    with pytest.raises(DataError, match=r"b\.csv: has no column of times; .*--time"):
        read_record(together(a, b))
    record = read_record(together(a, b), {"q_m": "q", "F": "F"}, time="stamp")
    np.testing.assert_array_equal(record.signals["F"], motion(t))


def test_columns_that_several_files_have_say_of_which_they_are(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    paths = [table(tmp_path / f"{name}.csv", t, "acc", t + k) for k, name in enumerate(("low", "high"))]
    source = open_record(together(*paths))
    assert source.names == ("t", "acc", "t (high)", "acc (high)")
    record = read_record(together(*paths), {"a": "acc", "b": "acc (high)"})
    np.testing.assert_allclose(record.signals["b"] - record.signals["a"], 1.0)


def test_a_comma_in_a_name_is_a_comma(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    path = table(tmp_path / "run 1,5 Nm.csv", t, "q", t)
    assert paths_of(path) == (path,)
    assert read_record(path).name == "run 1,5 Nm"


@pytest.mark.parametrize("name", ["x" * 5000 + ",b.csv", "a.csv,", ",", ",,b.csv", "a\0.csv,b.csv", "a,b"])
def test_names_that_are_none_are_explained(name: str) -> None:
    with pytest.raises(DataError):
        read_record(name)


@pytest.mark.slow
def test_import_lists_both_files_and_identify_takes_its_mapping(tmp_path: Path) -> None:
    run = CliRunner().invoke
    assert run(app, ["generate", "emps300", "--sensors", "qm_ac", "-o", str(tmp_path)]).exit_code == 0
    chirp = ["simulate", "emps300", "--sensors", "qm_ac", "--parameters", "light", "--duration-s", "3"]
    assert run(app, [*chirp, "--excitation", "chirp", "-o", str(tmp_path / "chirp.npz")]).exit_code == 0
    whole = read_record(tmp_path / "chirp.npz")
    t = np.arange(whole.n) / whole.fs
    drive = np.column_stack((t, whole.signals["q_m"], whole.signals["Gamma_m"]))[:-50]
    np.savetxt(tmp_path / "drive.csv", drive, delimiter=",", header="t,q_m,Gamma_m", comments="")
    sensor = np.column_stack((1e3 * t, whole.signals["a_c"]))[30:]
    np.savetxt(tmp_path / "sensor.csv", sensor, delimiter=",", header="time [ms],a_c", comments="")
    data, module = (
        str(together(tmp_path / "drive.csv", tmp_path / "sensor.csv")),
        str(tmp_path / "emps300_qm_ac.py"),
    )
    told = run(app, ["import", data, "--model", module])
    assert told.exit_code == 0, told.output
    assert (tmp_path / "drive.map.toml").is_file()
    done = run(
        app,
        [
            "identify",
            data,
            "--model",
            module,
            "--map-file",
            str(tmp_path / "drive.map.toml"),
            "--method",
            "wls",
            "--json",
        ],
    )
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["params"]["K"] == pytest.approx(0.3795, rel=1e-3)
