"""Files become records, or one message says where in the file the mistake is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.records.mapping_options import parse_mapping, parse_scales
from modelgen.runtime.records.read_record import read, read_record
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record

TABLE = "t,q_m,Gamma_m\n0.0,1.5,-2\n0.1,2.5,-3\n0.2,3.5e0,-4\n"


def file(folder: Path, text: str, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def complaint(path: Path, **options: Any) -> str:
    with pytest.raises(DataError) as caught:
        read_record(path, **options)
    assert len(caught.value.problems) == 1, str(caught.value)
    return str(caught.value)


def check_table(path: Path) -> None:
    record = read_record(path)
    assert (record.name, record.fs, list(record.signals)) == ("run", 10.0, ["q_m", "Gamma_m"])
    np.testing.assert_array_equal(record.signals["q_m"], [1.5, 2.5, 3.5])
    np.testing.assert_array_equal(record.signals["Gamma_m"], [-2.0, -3.0, -4.0])


@pytest.mark.parametrize(
    "text",
    [
        TABLE,
        TABLE.replace(",", ";"),
        TABLE.replace(",", ";").replace(".", ","),
        TABLE.replace(",", "\t"),
        TABLE.replace(",", " , "),
        TABLE.replace("\n", "\r\n"),
        TABLE.replace("q_m", '"q_m"').replace("-2", '"-2"'),
        "\ufeff" + TABLE,
        "# bench 3\n\n# second run, gain 2\n" + TABLE,
        TABLE.replace("0.1,", "# a pause\n\n0.1,"),
        TABLE.rstrip("\n"),
    ],
    ids=[
        "comma",
        "semicolon",
        "decimal comma",
        "tab",
        "spaces",
        "crlf",
        "quotes",
        "bom",
        "comments above",
        "comment within",
        "no newline at the end",
    ],
)
def test_text_formats(tmp_path: Path, text: str) -> None:
    check_table(file(tmp_path, text))


@pytest.mark.parametrize("suffix", [".txt", ".tsv", ".CSV"])
def test_text_suffixes(tmp_path: Path, suffix: str) -> None:
    check_table(file(tmp_path, TABLE, f"run{suffix}"))


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_text_of_other_encodings(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(TABLE.replace("Gamma_m", "angle °").encode(encoding))
    assert open_source(path).names == ("t", "q_m", "angle °")
    assert read_record(path, {"Gamma_m": "angle °"}).signals["Gamma_m"][2] == np.radians(-4.0)


def test_columns_that_nobody_asked_for_may_hold_anything(tmp_path: Path) -> None:
    text = "day,q_m,t,note\nMon,1.5,0.0,\nTue,2.5,0.1,x\n"
    record = read_record(file(tmp_path, text), needed=["q_m"])
    np.testing.assert_array_equal(record.signals["q_m"], [1.5, 2.5])
    assert record.fs == 10.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "run.csv: is empty"),
        ("# only\n\n", "run.csv: is empty"),
        ("t,q_m\n", "run.csv: has a header but no samples"),
        ("0.0,1.5\n0.1,2.5\n", "run.csv: line 1: holds numbers, not column names"),
        ("t,q_m,\n0,1,\n", "line 1: column 3 has no name"),
        ("# x\nt,q_m,q_m\n0,1,2\n", "line 2: two columns are named q_m"),
        ("t,q_m\n0.0,1\n\n0.1,one\n", "line 4, column q_m: is 'one', no number"),
        ("t,q_m\n0.0,1\n0.1,\n", "run.csv: column q_m, sample 1: is nan"),
        ("t,q_m\n0.0,1\n[s],[rad]\n", "line 3, column q_m: is '[rad]', no number"),
        ("t,q_m\n0.0,1\n0.1,2,3\n", "line 3: has 3 cells, the header has 2"),
        ("t,q_m\n0,0,1,5\n0,1,2,5\n", "line 2: has 4 cells, the header has 2"),
        ("t,q_m\n0.0\n0.1\n", "line 2: has 1 cells, the header has 2"),
        ("t;q_m\n0,0;1_5\n0,1;2\n", "line 2, column q_m: is '1_5', no number"),
        ("t,q_m\n0.0,1\n0.1,nan\n", "run.csv: column q_m, sample 1: is nan"),
        ('# modelgen record {"fs": 1\n' + TABLE, "line 1: is a damaged record header"),
        ('# modelgen record {"fs": "1", "name": "a", "tag": null}\n' + TABLE, "is a damaged record header"),
    ],
)
def test_a_mistake_in_the_text_is_located(tmp_path: Path, text: str, words: str) -> None:
    assert words in complaint(file(tmp_path, text))


def test_mapping_and_scales(tmp_path: Path) -> None:
    path = file(tmp_path, "t,theta,load,iq\n0,1,2,3\n0.1,4,5,6\n")
    record = read_record(
        path,
        mapping={"q_m": "theta", "q_c": "-load", "unused": "nowhere"},
        scales={"q_c": 0.001, "iq": 2, "unused": 4},
        needed=("q_c", "q_m", "iq"),
        name="A",
        tag="chirp",
    )
    assert (list(record.signals), record.name, record.tag) == (["q_c", "q_m", "iq"], "A", "chirp")
    np.testing.assert_array_equal(record.signals["q_c"], [-0.002, -0.005])
    np.testing.assert_array_equal(record.signals["q_m"], [1.0, 4.0])
    np.testing.assert_array_equal(record.signals["iq"], [6.0, 12.0])


def test_without_needed_keys_the_mapping_decides(tmp_path: Path) -> None:
    record = read_record(file(tmp_path, TABLE), {"F": "Gamma_m"})
    assert list(record.signals) == ["F"]


def test_a_factor_may_be_written_as_it_is_thought(tmp_path: Path) -> None:
    counts = read_record(file(tmp_path, TABLE), scales={"q_m": "2*pi/4096"}).signals["q_m"]
    plain = read_record(file(tmp_path, TABLE)).signals["q_m"]
    np.testing.assert_allclose(counts, 2.0 * np.pi / 4096.0 * plain, rtol=1e-15)
    with pytest.raises(DataError, match=r"scale of q_m: is '2\^12', which cannot be read .*write a power"):
        read_record(file(tmp_path, TABLE), scales={"q_m": "2^12"})
    with pytest.raises(DataError, match="scale of q_m: is inf; give a magnitude"):
        read_record(file(tmp_path, TABLE), scales={"q_m": "1e999"})
    assert parse_scales(["q_m=2*pi/4096", "F=gtau"]) == {"q_m": 2.0 * np.pi / 4096.0, "F": "gtau"}


def test_every_absent_name_is_reported_at_once(tmp_path: Path) -> None:
    with pytest.raises(DataError) as caught:
        read_record(
            file(tmp_path, TABLE),
            mapping={"q_c": "q_mm"},
            scales={"q_c": "gain", "q_d": 2.0, "Gamma_m": 0.0},
            time="tt",
            needed=("q_c", "a_c", "Gamma_m"),
        )
    problems = [str(problem).partition("run.csv: ")[2] for problem in caught.value.problems]
    assert problems == [
        "channel q_c: has no column q_mm; did you mean q_m? available: t, q_m, Gamma_m",
        "scale of q_c: has no scalar gain; available: none",
        "channel a_c: has no column a_c; available: t, q_m, Gamma_m; "
        "name it (--map a_c=COLUMN), or let `modelgen import` propose one",
        "scale of Gamma_m: is 0.0; give a magnitude from 1e-30 to 1e+30",
        "scale of q_d: has no channel q_d; did you mean q_c? available: q_c, a_c, Gamma_m",
        "times: has no column tt; did you mean t? available: t, q_m, Gamma_m",
    ]


def test_sampling_frequency_of_a_table(tmp_path: Path) -> None:
    assert read_record(file(tmp_path, TABLE), fs=10.0).fs == 10.0
    assert "column t: says 10 Hz, but 20 Hz is stated" in complaint(file(tmp_path, TABLE), fs=20.0)
    late = file(tmp_path, TABLE.replace("0.2,", "0.3,") + "0.4,1,1\n0.5,1,1\n")
    assert "column t, sample 2: jumps by 0.2 where the step is 0.1" in complaint(late)
    named = file(tmp_path, TABLE.replace("t,", "stamp,"))
    assert "has no sampling frequency" in complaint(named)
    assert read_record(named, time="stamp").fs == 10.0
    assert list(read_record(named, fs=5.0).signals) == ["stamp", "q_m", "Gamma_m"]


def test_text_that_is_no_time_does_not_matter_where_fs_is_given(tmp_path: Path) -> None:
    path = file(tmp_path, "time,q_m\nstart,1\nlater,2\n")
    assert read_record(path, fs=10.0).fs == 10.0
    assert "line 2, column time: is 'start', no number" in complaint(path)
    assert "line 2, column time" in complaint(path, fs=10.0, time="time")


def test_archive(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    column = np.arange(6, dtype=np.uint16)[:, None]
    np.savez(path, q_m=column, q_c=np.arange(6.0)[None, :], gain=np.float32(0.5), fs=250, m=np.eye(3))
    assert open_source(path).names == ("q_m", "q_c", "m[:,0]", "m[:,1]", "m[:,2]")
    record = read_record(path, {"q_m": "-q_m"}, {"q_m": "gain"}, needed=["q_m", "q_c"])
    assert record.fs == 250.0
    np.testing.assert_array_equal(record.signals["q_m"], -0.5 * np.arange(6))
    np.testing.assert_array_equal(record.signals["q_c"], np.arange(6))
    assert read_record(path, fs=500.0).fs == 500.0


def test_a_scalar_of_the_sampling_period_states_the_frequency(tmp_path: Path) -> None:
    """MATLAB's `Ts`, Simulink's `SampleTime`: where neither a frequency nor times say more."""
    q_m, path = np.arange(6.0), tmp_path / "run.npz"
    for name in ("Ts", "dt", "SampleTime"):
        np.savez(path, q_m=q_m, **{name: 1e-4})
        found = read(path)
        assert found.record.fs == 10_000.0
        assert f"{name} = 0.0001, taken for the sampling period in s: 10000 Hz" in found.took
    np.savez(path, q_m=q_m, Ts=1e-4, fs=500.0)
    assert read_record(path).fs == 500.0
    np.savez(path, q_m=q_m, Ts=1e-4, t=q_m / 50.0)
    assert read_record(path).fs == pytest.approx(50.0)
    for wrong in ({"Ts": 1e-4, "dt": 1e-3}, {"Ts": 0.0}, {"Ts": -1.0}, {"gain": 2.0}):
        np.savez(path, q_m=q_m, **wrong)
        assert "has no sampling frequency" in complaint(path)


def test_flags_and_complex_numbers_are_no_readings(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q_m=np.array([True, False]), q_c=np.array([1j, 2j]), fs=250)
    assert "data type bool" in complaint(tmp_path / "run.npz", needed=["q_m"], scales={"q_m": 2.0})
    assert "data type complex128" in complaint(tmp_path / "run.npz", mapping={"q_m": "-q_c"})


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q_m=np.array([1.0, None]), fs=250)
    assert "is no NumPy archive (its members are no plain arrays)" in complaint(tmp_path / "run.npz")


def test_what_is_no_archive(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(b"PK\x03\x04 not really")
    assert "is no NumPy archive" in complaint(path)
    path.write_bytes(b"")
    assert "is empty" in complaint(path)
    with path.open("wb") as opened:
        np.save(opened, np.arange(3.0))
    assert "a single array without a name" in complaint(path)


def test_matlab_file(tmp_path: Path) -> None:
    from scipy.io import savemat

    path = tmp_path / "run.mat"
    values = {
        "q": np.arange(4.0)[:, None],
        "i": [[4, 5, 6, 7]],
        "ref": np.arange(9.0),
        "gtau": 35.5,
        "Fs": 100.0,
    }
    savemat(path, {**values, "note": "text", "s": {"a": 1.0}})
    assert set(open_source(path).names) == {"q", "i", "ref"}
    record = read_record(path, {"q_m": "q", "F": "-i"}, {"F": "gtau"})
    assert record.fs == 100.0
    np.testing.assert_array_equal(record.signals["F"], -35.5 * np.arange(4, 8))
    assert "channels differ in length: q 4, ref 9" in complaint(path, needed=["q", "ref"])


def test_times_of_another_length_only_matter_when_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q_m=np.arange(4.0), t=np.arange(9.0) / 50.0, fs=100.0)
    assert read_record(tmp_path / "run.npz").fs == 100.0
    assert "column t: has 9 samples" in complaint(tmp_path / "run.npz", time="t")


def test_what_is_no_matlab_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600))
    assert "is no readable HDF5 file" in complaint(path)
    path.write_bytes(b"neither this nor that " * 30)
    assert "is no readable MATLAB file" in complaint(path)


def test_the_file_itself(tmp_path: Path) -> None:
    for suffix in (".csv", ".npz", ".mat"):
        assert "cannot be read (No such file or directory)" in complaint(tmp_path / f"absent{suffix}")
    assert "has the suffix '.xlsx'; save the sheet as CSV, or give a file of" in complaint(
        tmp_path / "a.xlsx"
    )
    assert "has no suffix" in complaint(tmp_path / "run")
    with pytest.raises(DataError, match=r"is a folder; give a file$"):
        open_source(tmp_path)
    # a bag of ROS 2 is a folder, and people give it
    for name in ("metadata.yaml", "run_0.db3", "run_1.db3"):
        (tmp_path / name).touch()
    with pytest.raises(DataError, match=r"is a folder; give a file in it: run_0\.db3, run_1\.db3"):
        open_source(tmp_path)


def test_parse_mapping() -> None:
    assert parse_mapping(["q_m=theta_mx", "q_c = -theta_my", "i=a=b"]) == {
        "q_m": "theta_mx",
        "q_c": "-theta_my",
        "i": "a=b",
    }
    with pytest.raises(DataError) as caught:
        parse_mapping(["q_m", "=x", "q_c=", "q_c=-", "2x=a", "q_m=a", "q_m=b"])
    wheres = [problem.where for problem in caught.value.problems]
    assert wheres == [f"--map {item}" for item in ("q_m", "=x", "q_c=", "q_c=-", "2x=a", "q_m=b")]
    assert "gives q_m a second time" in caught.value.problems[-1].what


def test_parse_scales() -> None:
    assert parse_scales(["F=35.15065188", "q=-1e-3", "G=gtau"]) == {
        "F": 35.15065188,
        "q": -0.001,
        "G": "gtau",
    }
    with pytest.raises(DataError) as caught:
        parse_scales(["F", "F=0", "F=nan", "F=1e-", "F=2", "F=3"])
    assert [problem.where for problem in caught.value.problems] == [
        f"--scale {item}" for item in ("F", "F=0", "F=nan", "F=1e-", "F=3")
    ]


def test_positioning_bench(shared_data: Path) -> None:
    path = shared_data / "emps" / "DATA_EMPS.mat"
    assert set(open_source(path).names) == {"qm", "qg", "t", "vir"}
    record = read_record(path, {"q_m": "qm", "F": "vir"}, {"F": "gtau"}, needed=("q_m", "F"))
    assert (record.name, record.fs, record.n) == ("DATA_EMPS", 1000.0, 24841)
    np.testing.assert_allclose(
        record.signals["F"], read_record(path, {"F": "vir"}, {"F": 35.15065188}).signals["F"], rtol=1e-9
    )


def test_two_mass_bench(shared_data: Path) -> None:
    """Its times are in microseconds: only the stated frequency can be right."""
    path = shared_data / "two_mass_bench" / "MultisineTypeA.mat"
    mapping = {"q_m": "theta_mx", "q_c": "-theta_my", "i": "iq_adx"}
    record = read_record(path, mapping)
    assert (record.fs, record.n, list(record.signals)) == (2500.0, 50000, ["q_m", "q_c", "i"])
    # both angles now turn the same way: the load follows the motor below the antiresonance
    assert np.corrcoef(record.signals["q_m"], record.signals["q_c"])[0, 1] > 0.0
    with pytest.raises(DataError, match=r"column time: says 0\.0025 Hz, but 5000 Hz is stated"):
        read_record(path, mapping, fs=5000.0)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("needed", [None, ("q", "T"), ("T",)])
def test_a_torque_named_T_is_no_column_of_times(
    tmp_path: Path, suffix: str, needed: tuple[str, ...] | None
) -> None:
    rng = np.random.default_rng(0)
    record = Record({"q": rng.normal(size=50), "T": rng.normal(size=50)}, 500.0, "run")
    path = tmp_path / f"run{suffix}"
    write_record(path, record)
    found = read_record(path, needed=needed)
    assert found.fs == 500.0
    for key in needed or ("q", "T"):
        assert np.array_equal(found.signals[key], record.signals[key])


def test_a_column_T_holds_times_where_nothing_else_does(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    lines = ["T,q", *(f"{0.002 * k:.3f},{k * k}" for k in range(50))]
    path.write_text("\n".join(lines) + "\n")
    found = read_record(path)
    assert found.fs == 500.0
    assert list(found.signals) == ["q"]


@pytest.mark.parametrize("order", ["T,t,q,v", "t,q,T,v", "t,T,q,v", "t,q,v,T"])
def test_wherever_it_stands_a_torque_named_T_is_no_second_column_of_times(tmp_path: Path, order: str) -> None:
    path = tmp_path / "run.csv"
    columns = {
        "T": [f"{-k * k}" for k in range(50)],
        "t": [f"{0.002 * k:.3f}" for k in range(50)],
        "q": [f"{k * k}" for k in range(50)],
        "v": [f"{2 * k}" for k in range(50)],
    }
    lines = zip(*(columns[name] for name in order.split(",")), strict=True)
    path.write_text("\n".join([order, *(",".join(line) for line in lines)]) + "\n")
    found = read_record(path)
    assert found.fs == 500.0
    assert set(found.signals) == {"T", "q", "v"}


def test_a_column_of_times_may_end_in_its_unit(tmp_path: Path) -> None:
    for name, factor in (("time_s", 1.0), ("t_ms", 1e3), ("Zeit_us", 1e6)):
        rows = "".join(f"{factor * 0.002 * k:.6g},{k % 7}\n" for k in range(40))
        (tmp_path / "a.csv").write_text(f"{name},q\n{rows}")
        assert read_record(tmp_path / "a.csv").fs == pytest.approx(500.0)
    # a torque of a body s
    (tmp_path / "a.csv").write_text("t,T_s\n" + "".join(f"{0.002 * k:.6g},{k % 7}\n" for k in range(40)))
    assert set(read_record(tmp_path / "a.csv").keys) == {"T_s"}


def test_times_in_ms_without_a_unit_are_not_taken_for_seconds(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,q\n" + "\n".join(f"{0.5 * n},{n % 7}" for n in range(100)), encoding="utf-8")
    with pytest.raises(DataError, match=r"states no unit, and steps by 0\.5, as times in ms do"):
        read_record(path)
    assert read_record(path, time_unit="ms").fs == pytest.approx(2000.0)
    assert read_record(path, time_unit="s").fs == pytest.approx(2.0)
    path.write_text("t,q\n" + "\n".join(f"{0.1 * n},{n % 7}" for n in range(100)), encoding="utf-8")
    assert read(path).took[-1] == "times: column t states no unit; taken for s, 10 Hz"


def test_one_column_is_one_channel(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(
        "t,q,tau\n" + "\n".join(f"{0.01 * n},{n % 7},{n % 5}" for n in range(100)), encoding="utf-8"
    )
    units = {"q_m": "rad", "q_c": "rad", "tau": "N m"}
    with pytest.raises(DataError, match=r"column q: is mapped to q_m and to q_c; .*--map q_c=COLUMN"):
        read_record(path, {"q_m": "q", "q_c": "-q", "tau": "tau"}, units=units)


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("Nm", "is in Nm, and rad is needed"),
        ("%", "is in %, and rad is needed"),
        ("ell", "'ell' is not known"),
    ],
)
def test_a_unit_that_is_said_for_a_channel_counts_and_must_be_of_its_quantity(
    tmp_path: Path, unit: str, words: str
) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,q\n" + "\n".join(f"{0.01 * n},{0.1 * n}" for n in range(100)), encoding="utf-8")
    for say in ({"stated_units": {"q": unit}}, {"stated_units": {"q": unit}, "mapping": {"q": "q"}}):
        with pytest.raises(DataError, match=words):
            read_record(path, units={"q": "rad"}, **say)
    turned = read_record(path, units={"q": "rad"}, stated_units={"q": "deg"})
    assert turned.signals["q"][6] == pytest.approx(0.6 * np.pi / 180.0)
    scaled = read_record(path, scales={"q": 2.0}, units={"q": "rad"}, stated_units={"q": unit})
    assert scaled.signals["q"][10] == 2.0
