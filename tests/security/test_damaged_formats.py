"""Files of every binary format, cut short or with bytes changed: a record or a message, no traceback."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read, read_record

T = np.arange(200) / 1000.0
SIGNALS = {"q_m": np.sin(20.0 * T), "F": np.cos(20.0 * T)}


def write_h5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = 1000.0
        for key, samples in SIGNALS.items():
            file.create_dataset(key, data=samples, compression="gzip")


def write_parquet(path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"t": T, **SIGNALS}), path)


def write_mf4(path: Path, signals: dict[str, Any] = SIGNALS, times: Any = T) -> None:
    asammdf = pytest.importorskip("asammdf")
    with warnings.catch_warnings(), asammdf.MDF(version="4.10") as file:
        warnings.simplefilter("ignore")
        file.append([asammdf.Signal(samples, times, name=key) for key, samples in signals.items()])
        file.save(path, overwrite=True, compression=1)


def write_tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    step = {"wf_increment": 0.001}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("log", key, samples, properties=step) for key, samples in SIGNALS.items()]
        )


def write_mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {**SIGNALS, "fs": 1000.0}, do_compression=True)


def write_npz(path: Path) -> None:
    np.savez_compressed(path, fs=1000.0, **SIGNALS)


WRITERS: dict[str, Callable[[Path], None]] = {
    "h5": write_h5,
    "parquet": write_parquet,
    "mf4": write_mf4,
    "tdms": write_tdms,
    "mat": write_mat,
    "npz": write_npz,
}


@pytest.fixture(autouse=True)
def unraisable(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is raised where nobody can catch it; Python would print a traceback."""
    caught: list[str] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda found: caught.append(repr(found.exc_value)))
    return caught


def good(folder: Path, kind: str) -> bytes:
    path = folder / f"good.{kind}"
    WRITERS[kind](path)
    assert read_record(path).n == 200
    return path.read_bytes()


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_that_was_cut_short(
    trap: Path, kind: str, share: float, unraisable: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    whole = good(trap, kind)
    path = trap / f"cut.{kind}"
    path.write_bytes(whole[: int(share * len(whole))])
    try:
        told = read(path).took
    except DataError as error:
        assert re.search(rf"cut\.{kind}: (is no|has no columns)|^cut: channels differ in length", str(error))
    else:
        assert told[-1].startswith("the file is damaged or was cut short: ")
    assert unraisable == []
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_with_changed_bytes(
    trap: Path, kind: str, unraisable: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    whole = good(trap, kind)
    path = trap / f"changed.{kind}"
    random = np.random.default_rng(1)
    refused = 0
    for _ in range(20):
        content = bytearray(whole)
        for place in random.integers(0, len(whole), 3):
            content[place] = random.integers(256)
        path.write_bytes(content)
        try:
            read_record(path)
        except DataError as error:
            refused += 1
            assert all(line.isprintable() for line in str(error).splitlines())
            assert "changed" in str(error)
    assert refused > 0
    assert unraisable == []
    assert capfd.readouterr().err == ""


def test_an_mdf_bomb(trap: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.runtime.files.size_limits.ALWAYS_FINE", 1_000_000)
    path = trap / "a.mf4"
    write_mf4(path, {"q_m": np.zeros(400_000)}, np.zeros(400_000))
    assert path.stat().st_size < 100_000
    with pytest.raises(DataError, match=r"a\.mf4: unpacks from \d+ bytes to 6\.4 MB or more"):
        read_record(path)


def test_a_parquet_bomb(trap: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr("modelgen.runtime.files.size_limits.ALWAYS_FINE", 1_000_000)
    path = trap / "a.parquet"
    parquet.write_table(arrow.table({"q_m": np.zeros(1_000_000)}), path)
    with pytest.raises(DataError, match=r"a\.parquet: unpacks from \d+ bytes to 8 MB or more"):
        read_record(path)


def test_an_hdf5_bomb(trap: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = trap / "a.h5"
    with h5py.File(path, "w") as file:  # stated, never written: a few kB on disk
        file.create_dataset("q_m", shape=(10**12,), dtype="f8", chunks=(1000,), compression="gzip")
    with pytest.raises(DataError, match=r"a\.h5: unpacks from \d+ bytes to 8e\+06 MB or more"):
        read_record(path)


def test_samples_in_another_file_are_not_read(trap: Path) -> None:
    h5py = pytest.importorskip("h5py")
    (trap / "secret").write_bytes(np.arange(200.0).tobytes())
    message = r"a\.h5: column q_m: keeps its samples in another file; export it whole, into one file"
    with h5py.File(trap / "a.h5", "w") as file:
        file.create_dataset("q_m", (200,), "f8", external=[(str(trap / "secret"), 0, 1600)])
    with pytest.raises(DataError, match=message):
        read_record(trap / "a.h5", fs=1000.0)
    write_h5(trap / "other.h5")
    with h5py.File(trap / "a.h5", "w") as file:
        layout = h5py.VirtualLayout((200,), "f8")
        layout[:] = h5py.VirtualSource(str(trap / "other.h5"), "q_m", (200,))
        file.create_virtual_dataset("q_m", layout)
    with pytest.raises(DataError, match=message):
        read_record(trap / "a.h5", fs=1000.0)


def test_links_to_another_file_are_not_followed(trap: Path) -> None:
    h5py = pytest.importorskip("h5py")
    write_h5(trap / "other.h5")
    with h5py.File(trap / "a.h5", "w") as file:
        file["F"] = SIGNALS["F"]
        file["q_m"] = h5py.ExternalLink(str(trap / "other.h5"), "/q_m")
    assert list(read_record(trap / "a.h5", fs=1000.0).signals) == ["F"]


def test_objects_and_references_in_hdf5_are_left_out(trap: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(trap / "a.h5", "w") as file:
        file["q_m"] = SIGNALS["q_m"]
        file["text"] = np.array([b"import os"] * 3)
        file.create_dataset("reference", (1,), dtype=h5py.ref_dtype)
        file.create_dataset("complex", data=np.ones(200, dtype=complex))
    assert list(read_record(trap / "a.h5", fs=1000.0).signals) == ["q_m"]


def test_groups_within_groups_are_refused_at_once(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["/".join("a" * 90) + "/q"] = T
    assert list(read(path, fs=1000.0).record.signals) == [".".join("a" * 90) + ".q"]
    with h5py.File(path, "a") as file:
        file["/".join("a" * 120) + "/q"] = T
    with pytest.raises(DataError, match="its groups are nested more than 100 deep"):
        read(path, fs=1000.0)
