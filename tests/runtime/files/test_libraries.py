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


@pytest.mark.parametrize("unit", ["unit_string", "NI_UnitDescription"])
def test_waveforms_of_labview_say_when_they_were_read(tmp_path: Path, unit: str) -> None:
    """One that starts later, by its offset or its date, is not of the same samples; 1 us is nothing."""
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2024-01-01T00:00:00", "us")
    rates = {
        "theta": {"wf_increment": 1e-3, "wf_start_time": start, unit: "deg"},
        "torque": {"wf_increment": 1e-3, "wf_start_time": start + np.timedelta64(1, "us")},
        "slow": {"wf_increment": 2e-3, "wf_start_time": start},
        "late": {"wf_increment": 1e-3, "wf_start_time": start, "wf_start_offset": 0.004},
        "undated": {"wf_increment": 1e-3},
    }
    path = tmp_path / "run.tdms"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("run", name, Q, how) for name, how in rates.items()])
    same = read_record(path, {"q": "theta", "F": "torque", "u": "undated"})
    assert same.fs == pytest.approx(1000.0)
    np.testing.assert_allclose(same.signals["q"], Q * np.pi / 180.0, rtol=1e-14)
    for other in ("slow", "late"):
        with pytest.raises(DataError, match="bring them together with --mend clocks"):
            read_record(path, {"q": "theta", "F": other})
    together = read_record(path, {"q": "theta", "F": "late"}, mend=["clocks"])
    np.testing.assert_allclose(together.signals["F"], Q[: together.n], atol=1e-9)
    np.testing.assert_allclose(together.signals["q"], Q[4:] * np.pi / 180.0, atol=1e-9)


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_unit_in_a_name_counts_in_every_format(tmp_path: Path, suffix: str) -> None:
    """But not in a name that is the channel's own: that of a joint."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / f"run{suffix}"
    arrays: dict[str, Any] = {
        "t_ms": 1e3 * T,
        "q_turns": Q,
        "pos [deg]": Q,
        "F_mNm": F,
        "all_deg": np.column_stack([Q, F]),
    }
    if suffix == ".npz":
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values
    names = {"a": "pos [deg]", "q_turns": "q_turns", "b": "q_turns", "F": "F_mNm", "m": "all_deg[:,0]"}
    record = read_record(path, {key: name for key, name in names.items() if key != "q_turns"})
    assert record.fs == pytest.approx(1000.0)
    for key, factor in {"a": np.pi / 180.0, "b": 2.0 * np.pi, "m": np.pi / 180.0}.items():
        np.testing.assert_allclose(record.signals[key], Q * factor, rtol=1e-14)
    np.testing.assert_allclose(record.signals["F"], 1e-3 * F, rtol=1e-14)
    own = read_record(path, needed=["q_turns", "pos [deg]"], time="t_ms").signals
    np.testing.assert_array_equal(own["q_turns"], Q)
    np.testing.assert_allclose(own["pos [deg]"], Q * np.pi / 180.0, rtol=1e-14)


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
