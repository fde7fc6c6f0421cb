from __future__ import annotations

import gc
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.files.open_channels import open_channels

N = 1000
ANGLE = np.cumsum(np.random.default_rng(0).standard_normal(N))
FORCE = np.arange(N, dtype=np.int32)


def write_hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["run/theta"], file["run/current"] = ANGLE, FORCE


def write_parquet(path: Path) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table = pyarrow.table({"run/theta": ANGLE, "run/current": FORCE})
    parquet.write_table(table, path, row_group_size=170)


def write_mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    times = np.arange(N) / 1000.0
    mdf = asammdf.MDF()
    mdf.append(
        [
            asammdf.Signal(samples=ANGLE, timestamps=times, name="run/theta"),
            asammdf.Signal(samples=FORCE, timestamps=times, name="run/current"),
        ]
    )
    mdf.save(path)
    mdf.close()


# asammdf complains in its finaliser of a file that it could not open
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("suffix", "write"), [(".h5", write_hdf5), (".parquet", write_parquet), (".mf4", write_mdf)]
)
def test_stretches_of_a_file_are_those_of_its_columns(tmp_path: Path, suffix: str, write: object) -> None:
    path = tmp_path / f"record{suffix}"
    write(path)  # type: ignore[operator]
    source = open_channels(path, {"q_m": ("run/theta", -1.0), "Gamma_m": ("run/current", 0.5)}, fs=1000.0)
    assert (source.n, source.fs, source.name) == (N, 1000.0, "record")
    for start, stop in ((0, 10), (160, 345), (170, 340), (999, 1000), (0, N)):
        np.testing.assert_array_equal(source.read("q_m", start, stop), -ANGLE[start:stop])
        np.testing.assert_array_equal(source.read("Gamma_m", start, stop), 0.5 * FORCE[start:stop])
    with ThreadPoolExecutor(4) as pool:  # the file is open many times at once
        parts = list(pool.map(lambda start: source.read("q_m", start, start + 10), range(0, N, 10)))
    np.testing.assert_array_equal(np.concatenate(parts), -ANGLE)
    with pytest.raises(DataError, match="has no column run/speed"):
        open_channels(path, {"q_m": ("run/speed", 1.0)}, fs=1000.0)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(DataError, match="record"):
        open_channels(path, {"q_m": ("run/theta", 1.0)}, fs=1000.0)
    gc.collect()


def test_npy_files_are_read_in_stretches(tmp_path: Path) -> None:
    np.save(tmp_path / "angle.npy", ANGLE)
    np.save(tmp_path / "force.npy", FORCE)
    paths = {"q_m": tmp_path / "angle.npy", "Gamma_m": tmp_path / "force.npy"}
    source = open_npy(paths, 1000.0, name="run", factors={"Gamma_m": 0.5})
    assert (source.n, source.name) == (N, "run")
    np.testing.assert_array_equal(source.read("q_m", 5, 9), ANGLE[5:9])
    np.testing.assert_array_equal(source.read("Gamma_m", 5, 9), 0.5 * FORCE[5:9])


def test_npy_files_that_are_none_or_do_not_fit_are_named(tmp_path: Path) -> None:
    np.save(tmp_path / "angle.npy", ANGLE)
    np.save(tmp_path / "short.npy", FORCE[:-1])
    np.save(tmp_path / "table.npy", np.zeros((3, 3)))
    (tmp_path / "text.npy").write_text("nothing")
    with pytest.raises(DataError, match=r"differ in length: q_m 1000, Gamma_m 999"):
        open_npy({"q_m": tmp_path / "angle.npy", "Gamma_m": tmp_path / "short.npy"}, 1000.0)
    for name, what in (
        ("table.npy", r"shape \(3, 3\)"),
        ("text.npy", "no readable"),
        ("no.npy", "cannot be read"),
    ):
        with pytest.raises(DataError, match=what):
            open_npy({"q_m": tmp_path / name}, 1000.0)


def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t\n0\n")
    with pytest.raises(DataError, match=r"has the suffix '\.csv'"):
        open_channels(tmp_path / "a.csv", {"q_m": ("t", 1.0)}, fs=1000.0)
    with pytest.raises(DataError, match="cannot be read"):
        open_channels(tmp_path / "a.h5", {"q_m": ("t", 1.0)}, fs=1000.0)
