"""Formats that need a library: written by it, read back to the last bit; damaged ones are explained."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read_record

N = 50
T = np.arange(N) / 1000.0
Q = np.sin(T * 40.0)
F = np.cos(T * 30.0)


def hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["run/time"] = T
        file["run/theta"] = Q[:, None]
        file["run/theta"].attrs["unit"] = "deg"
        file["torque"] = F
        file["note"] = "text"
        file.attrs["fs"] = 1000.0


def mat73(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("theta", Q), ("torque", F)):
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["fs"] = np.array([[1000.0]])
        file["title"] = np.array([[72], [105]], dtype=np.uint16)
        file["title"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))


def parquet_file(path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table({"time": T, "theta [deg]": Q, "torque": F}), path)


def mf4(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(Q, T, unit="deg", name="theta"),
            asammdf.Signal(F, T, unit="Nm", name="torque"),
        ]
        file.append(signals, common_timebase=True)
        file.save(path)


def tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    properties = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(path) as writer:
        channels = [
            nptdms.ChannelObject("run", "theta", Q, {**properties, "unit_string": "deg"}),
            nptdms.ChannelObject("run", "torque", F, properties),
        ]
        writer.write_segment(channels)


FORMATS = {
    ".h5": (hdf5, "run.theta", "h5py"),
    ".mat": (mat73, "theta", "h5py"),
    ".parquet": (parquet_file, "theta", "pyarrow.parquet"),
    ".mf4": (mf4, "theta", "asammdf"),
    ".tdms": (tdms, "theta", "nptdms"),
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("suffix", FORMATS)
def test_round_trip(tmp_path: Path, suffix: str) -> None:
    write, theta, _ = FORMATS[suffix]
    path = tmp_path / f"run{suffix}"
    write(path)
    record = read_record(path, {"q": theta, "F": "-torque"})
    assert record.fs == 1000.0
    scale = 1.0 if suffix == ".mat" else np.pi / 180.0
    np.testing.assert_allclose(record.signals["q"], Q * scale, rtol=1e-14)
    np.testing.assert_array_equal(record.signals["F"], -F)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("suffix", [".h5", ".parquet", ".mf4", ".tdms"])
def test_what_is_no_such_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    with pytest.raises(DataError, match="cannot be read"):
        read_record(path)
    path.write_bytes(b"neither this nor that " * 30)
    with pytest.raises(DataError, match="is no readable"):
        read_record(path)


@pytest.mark.parametrize("suffix", [".h5", ".parquet", ".mf4", ".tdms"])
def test_a_missing_library_is_named(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    library: Any = FORMATS[suffix][2]
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"x")
    with pytest.raises(DataError, match=r"is not installed; get it with: pip install 'modelgen\[io\]'"):
        read_record(path)
