"""Files of very many columns, very long names and very long lines: linear work, or a message at once."""

from __future__ import annotations

import io
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.cli.import_file import MOST_LINES, describe_file, import_lines
from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.size_limits import MOST_COLUMNS
from modelgen.runtime.files.text_lines import LONGEST_LINE  # imported before a test sets other limits
from modelgen.runtime.records.read_record import read_record

T = np.arange(6) / 100.0


def table(names: list[str], path: Path) -> None:
    row = ",".join(["{}"] * len(names))
    lines = [",".join(names), *(row.format(*([t] * len(names))) for t in T)]
    path.write_text("\n".join(lines) + "\n")


def text_csv(count: int, path: Path) -> None:
    table(["t", *(f"c{k} [deg]" for k in range(count - 1))], path)


def times_csv(count: int, path: Path) -> None:
    table(["t" for _ in range(count)], path)


def words_csv(count: int, path: Path) -> None:
    text_csv(count, path)
    with path.open("a") as file:
        file.write(",".join(["word"] * count) + "\n")


def npz(count: int, path: Path) -> None:
    np.savez(path, t=T, **{f"c{k}": T for k in range(count - 1)})  # type: ignore[arg-type]


def mat(count: int, path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": T, **{f"c{k}": T for k in range(count - 1)}})


def traces_mat(count: int, path: Path) -> None:
    from scipy.io import savemat

    X = np.zeros((1,), dtype=[("Name", "O"), ("Data", "O")])
    X[0] = ("", T)
    Y = np.zeros((count - 1,), dtype=[("Name", "O"), ("Unit", "O"), ("Data", "O")])
    for k in range(count - 1):
        Y[k] = ("same", "deg", T)
    savemat(path, {"run": {"X": X, "Y": Y}})


def hdf5(count: int, path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["t"] = T
        for k in range(count - 1):
            file[f"c{k}"] = T


def parquet(count: int, path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"t": T, **{f"c{k}": T for k in range(count - 1)}}), path)


def tdms(count: int, path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("log", f"c{k}", T) for k in range(count)])


WIDE: dict[str, tuple[str, Callable[[int, Path], None]]] = {
    "text": ("a.csv", text_csv),
    "times": ("a.csv", times_csv),
    "words": ("a.csv", words_csv),
    "npz": ("a.npz", npz),
    "mat": ("a.mat", mat),
    "traces": ("a.mat", traces_mat),
    "hdf5": ("a.h5", hdf5),
    "parquet": ("a.parquet", parquet),
    "tdms": ("a.tdms", tdms),
}


def work(path: Path) -> int:
    """Return how many calls it takes to describe a file: of functions, generators and methods of C."""
    calls = 0

    def count(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        import_lines(describe_file(path, None), None, None)
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.slow
@pytest.mark.parametrize("kind", WIDE)
def test_work_grows_with_the_columns_not_with_their_square(processes: Path, kind: str) -> None:
    name, write = WIDE[kind]
    path = processes / name
    calls = []
    for count in (50, 300, 600):
        write(count, path)
        calls.append(work(path))
    # the first has loaded the libraries
    assert calls[2] < 2.2 * calls[1]


# to look for a name in a tuple is no call that is counted above; at this width it would take minutes
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["text", "npz", "mat", "hdf5"])
def test_as_many_columns_as_are_read(processes: Path, kind: str) -> None:
    name, write = WIDE[kind]
    path = processes / name
    write(MOST_COLUMNS, path)
    described = describe_file(path, None)
    assert len(described["columns"]) == MOST_COLUMNS
    lines = import_lines(described, None, None)
    assert len(lines) < 3 * MOST_LINES
    assert f"and {MOST_COLUMNS - MOST_LINES - 1} more columns: --json lists them all" in lines
    record = read_record(path, {"q_m": "c7", "F": "-c9"}, fs=100.0)
    assert list(record.signals) == ["q_m", "F"]


@pytest.mark.parametrize("kind", WIDE)
def test_one_column_more_is_refused(processes: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, write = WIDE[kind]
    monkeypatch.setattr("modelgen.runtime.files.size_limits.MOST_COLUMNS", 99)
    write(100, processes / name)
    with pytest.raises(
        DataError, match=r"holds \d+ columns or more, at most 99 are read; export the columns"
    ):
        open_source(processes / name)


def many_members() -> bytes:
    """Return an archive whose table lists 100,000 members; one is there."""
    content = io.BytesIO()
    np.save(content, T)
    data = content.getvalue()
    stated = struct.pack("<3I", zlib.crc32(data), len(data), len(data))
    local = struct.pack("<4s5H", b"PK\3\4", 20, 0, 0, 0, 0) + stated
    listed = b"".join(
        struct.pack("<4s6H", b"PK\1\2", 20, 20, 0, 0, 0, 0)
        + stated
        + struct.pack("<5H2I", 9, 0, 0, 0, 0, 0, 0)
        + b"%05d.npy" % k
        for k in range(100_000)
    )
    start = local + struct.pack("<2H", 9, 0) + b"00000.npy" + data
    return start + listed + struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 65535, 65535, len(listed), len(start), 0)


def long_members() -> bytes:
    content, member = io.BytesIO(), io.BytesIO()
    np.save(member, T)
    with zipfile.ZipFile(content, "w") as file:
        file.writestr("n" * 60_000 + ".npy", member.getvalue())
    return content.getvalue()


LONG = "x" * 100_000
REFUSED: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "a line without an end": (
        "a.csv",
        lambda: b"1,2,3," * 1_000_000,
        f"a line of more than {LONGEST_LINE} characters",
    ),
    "a later line without an end": ("a.csv", lambda: b"t,q\n0,1\n1,2\n" + b"x" * 7_000_000, "a line of more"),
    "a million columns": ("a.csv", lambda: b"c," * 1_000_000 + b"c\n", r"holds 1000001 columns or more"),
    "a million numbers": ("a.txt", lambda: (b"1 " * 1_000_000 + b"\n") * 2, r"holds 1000000 columns or more"),
    "long names": (
        "a.csv",
        lambda: f"t,{LONG}\n0,1\n1,2\n".encode(),
        "names a column with 100000 characters",
    ),
    "many members": ("a.npz", many_members, r"holds \d+ columns or more"),
    "long members": ("a.npz", long_members, "names a column with 60000 characters"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_person_means_is_refused(trap: Path, name: str) -> None:
    file, make, message = REFUSED[name]
    (trap / file).write_bytes(make())
    with pytest.raises(DataError, match=message) as caught:
        open_source(trap / file)
    assert len(str(caught.value)) < 1000


def test_old_line_ends_are_line_ends(trap: Path) -> None:
    (trap / "a.csv").write_bytes(b"t,q_m\r" + b"".join(b"%d,%d\r" % (k, k) for k in range(600_000)))
    assert open_source(trap / "a.csv").names == ("t", "q_m")


def test_a_table_with_a_word_is_read_once_for_all_its_columns(
    trap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words_csv(200, trap / "a.csv")
    opened = []
    real = Path.open
    monkeypatch.setattr(Path, "open", lambda self, *a, **k: (opened.append(self), real(self, *a, **k))[1])
    (trap / "a.csv").write_text((trap / "a.csv").read_text().replace("word,word", "7.0,word", 1))
    described = describe_file(trap / "a.csv", None)
    assert [entry["samples"] for entry in described["columns"][:3]] == [len(T) + 1, 0, 0]
    assert len(opened) < 20
