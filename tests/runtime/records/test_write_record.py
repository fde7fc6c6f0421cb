"""What is written is read back to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record


@pytest.fixture
def record() -> Record:
    rng = np.random.default_rng(3)
    wide = rng.normal(size=50) * 10.0 ** rng.integers(-300, 29, 50)
    wide[:4] = [5e-324, -9.999999999999999e29, 0.1, -0.0]
    return Record({"q_m": wide, "Gamma_m": rng.normal(size=50)}, 4999.7, name="café, run 1", tag="chirp")


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_round_trip(tmp_path: Path, record: Record, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    write_record(path, record)
    back = read_record(path)
    assert back == record
    assert np.signbit(back.signals["q_m"][3])
    assert read_record(path, name="other", tag="trapezoid", needed=["Gamma_m"]) == Record(
        {"Gamma_m": record.signals["Gamma_m"]}, record.fs, "other", "trapezoid"
    )


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_round_trip_without_a_tag(tmp_path: Path, suffix: str) -> None:
    record = Record({"q_m": [0.0, 1.0, 2.0]}, 1.0)
    write_record(tmp_path / f"run{suffix}", record)
    assert read_record(tmp_path / f"run{suffix}") == record


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_the_same_record_is_the_same_bytes(tmp_path: Path, record: Record, suffix: str) -> None:
    paths = [tmp_path / f"{stem}{suffix}" for stem in ("one", "two")]
    for path in paths:
        write_record(path, record)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_the_text_is_plain(tmp_path: Path) -> None:
    write_record(tmp_path / "run.csv", Record({"q_m": [0.1, 2.0], "a_c": [3.0, 4e-9]}, 8.0, name="run"))
    assert (tmp_path / "run.csv").read_text(encoding="utf-8") == (
        '# modelgen record {"fs": 8.0, "name": "run", "tag": null}\nt,q_m,a_c\n0.0,0.1,3.0\n0.125,2.0,4e-09\n'
    )


def test_an_archive_holds_plain_arrays(tmp_path: Path, record: Record) -> None:
    write_record(tmp_path / "run.npz", record)
    with np.load(tmp_path / "run.npz", allow_pickle=False) as archive:
        assert archive.files == ["fs", "name", "tag", "q_m", "Gamma_m"]
        assert archive["fs"] == record.fs
        np.testing.assert_array_equal(archive["q_m"], record.signals["q_m"])


def test_a_file_is_not_overwritten_unasked(tmp_path: Path, record: Record) -> None:
    path = tmp_path / "run.csv"
    path.write_text("precious", encoding="utf-8")
    with pytest.raises(ModelgenError, match="exists already"):
        write_record(path, record)
    assert path.read_text(encoding="utf-8") == "precious"
    write_record(path, record, overwrite=True)
    assert read_record(path) == record


def test_only_two_formats_are_written(tmp_path: Path, record: Record) -> None:
    with pytest.raises(DataError, match=r"has the suffix '\.mat'; write to a \.csv or \.npz file"):
        write_record(tmp_path / "run.mat", record)


@pytest.mark.parametrize("key", ["t", "time", "a,b", "a;b", "a\tb", "a\nb", " a", "a ", "-a", "#a", 'a"b'])
def test_a_key_that_could_not_be_read_back_is_refused(tmp_path: Path, key: str) -> None:
    with pytest.raises(DataError, match="rename the channel"):
        write_record(tmp_path / "run.csv", Record({key: [0.0, 1.0]}, 1.0))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("key", ["fs", "name", "tag", "a/b"])
def test_a_key_that_the_archive_needs_is_refused(tmp_path: Path, key: str) -> None:
    with pytest.raises(DataError, match="rename the channel"):
        write_record(tmp_path / "run.npz", Record({key: [0.0, 1.0]}, 1.0))


def test_keys_that_numpy_savez_could_not_take(tmp_path: Path) -> None:
    record = Record({"file": [0.0, 1.0], "allow_pickle": [2.0, 3.0]}, 10.0)
    write_record(tmp_path / "run.npz", record)
    assert read_record(tmp_path / "run.npz", name="record") == record
