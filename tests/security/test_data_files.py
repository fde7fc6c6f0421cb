"""Hostile and damaged data files: one message each that names the file, no pickle loaded."""

from __future__ import annotations

import io
import pickle
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read_record


class Payload:
    """Unpickling it would create the file."""

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, ("pwned", "w")


def npz(**arrays: object) -> bytes:
    data = io.BytesIO()
    np.savez_compressed(data, **arrays)  # type: ignore[arg-type]
    return data.getvalue()


def archive(member: str, content: bytes, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", compression) as file:
        file.writestr(member, content)
    return data.getvalue()


def npy(header: str, content: bytes = b"") -> bytes:
    text = header.encode("latin1") + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content


def encrypted() -> bytes:
    content = bytearray(archive("q_m.npy", npy("{}")))
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + place] |= 1
    return bytes(content)


def mat_bomb() -> bytes:
    """Return a MATLAB file (level 5) with one compressed variable of 4 MB zeros in 4 kB."""
    size = 4_000_000
    flags, shape = struct.pack("<4I", 6, 8, 6, 0), struct.pack("<2I2i", 5, 8, size // 8, 1)
    head = flags + shape + struct.pack("<2H4s", 1, 3, b"q_m") + struct.pack("<2I", 9, size)
    body = zlib.compress(struct.pack("<2I", 14, len(head) + size) + head + bytes(size))
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(body)) + body


OBJECTS = np.array([Payload(), None], dtype=object)
OBJECT = "no plain arrays"
MARK = "line 1: is a damaged record header"
PICKLE = pickle.dumps(Payload())
GOOD = npz(fs=1000.0, q_m=np.sin(np.arange(100.0)))
HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (%s,), }"

ARCHIVES: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "is empty"),
    "text": (lambda: b"t,q_m\n0,1\n", "is no NumPy archive"),
    "pickle": (lambda: PICKLE, "is no NumPy archive"),
    "pickle as a member": (lambda: archive("q_m.npy", PICKLE), "is no NumPy archive|data type"),
    "object array": (lambda: npz(q_m=OBJECTS), OBJECT),
    "object array next to a good one": (
        lambda: npz(q_m=np.ones(9), a_c=OBJECTS),
        OBJECT,
    ),
    "single array": (lambda: npy(HEADER % 2, bytes(16)), "holds a single array without a name"),
    "single object array": (lambda: npy(HEADER.replace("<f8", "|O") % 1, PICKLE), OBJECT),
    "code in the header": (lambda: archive("q_m.npy", npy("open('pwned','w')")), "is no NumPy archive"),
    "broken header": (lambda: archive("q_m.npy", npy("{'descr':")), "is no NumPy archive"),
    "deep header": (lambda: archive("q_m.npy", npy("[" * 9000)), "is no NumPy archive"),
    "huge header": (lambda: archive("q_m.npy", npy("{" + " " * 60_000 + "}")), "is no NumPy archive"),
    "huge sum in the header": (lambda: archive("q_m.npy", npy(HEADER % "10**15")), "is no NumPy archive"),
    "odd type": (lambda: archive("q_m.npy", npy(HEADER.replace("<f8", "<zz") % 1)), "is no NumPy archive"),
    "negative shape": (lambda: archive("q_m.npy", npy(HEADER % -5)), "is no NumPy archive"),
    "shape beyond memory": (lambda: archive("q_m.npy", npy(HEADER % 10**15)), "is no NumPy archive"),
    "shape beyond integers": (lambda: archive("q_m.npy", npy(HEADER % 10**30)), "is no NumPy archive"),
    "shape without data": (lambda: archive("q_m.npy", npy(HEADER % 10**8)), "is no NumPy archive"),
    "truncated": (lambda: GOOD[: len(GOOD) // 2], "is no NumPy archive"),
    "truncated by a byte": (lambda: GOOD[:-1], "is no NumPy archive"),
    "flipped byte": (lambda: GOOD[:400] + bytes([GOOD[400] ^ 255]) + GOOD[401:], "is no NumPy archive"),
    "encrypted": (encrypted, "is no NumPy archive"),
    "zip bomb": (lambda: archive("q_m.npy", bytes(4_000_000)), "unpacks from .* bytes to 4 MB or more"),
    "nested path": (
        lambda: archive("../../pwned.npy", npy(HEADER % 2, bytes(16))),
        "has no sampling frequency|fs",
    ),
    "dates": (lambda: npz(fs=1.0, q_m=np.array(["2020-01-01", "2020-01-02"], "datetime64[D]")), "data type"),
    "complex": (lambda: npz(fs=1.0, q_m=np.array([1j, 2.0])), "data type complex128"),
    "texts": (lambda: npz(fs=1.0, q_m=np.array(["1", "2"])), "data type <U1"),
    "booleans": (lambda: npz(fs=1.0, q_m=np.array([True, False])), "data type bool"),
    "not a number": (
        lambda: npz(fs=1.0, q_m=np.array([1.0, np.nan, 3.0])),
        r"column q_m, sample 1: is nan \(1 of 3",
    ),
    "infinite": (lambda: npz(fs=1.0, q_m=np.array([1.0, 2.0, -np.inf])), "sample 2: is -inf"),
    "no samples": (lambda: npz(fs=1.0, q_m=np.zeros(0)), "no column|has no channels|q_m"),
    "one sample": (lambda: npz(fs=1.0, q_m=np.zeros(1)), "no column|has no channels|q_m"),
    "different lengths": (lambda: npz(fs=1.0, q_m=np.ones(3), a_c=np.ones(4)), "differ in length|samples"),
    "no frequency": (lambda: npz(q_m=np.ones(3)), "fs|sampling"),
    "zero frequency": (lambda: npz(fs=0.0, q_m=np.ones(3)), "fs|finite and positive"),
    "negative frequency": (lambda: npz(fs=-1.0, q_m=np.ones(3)), "fs|finite and positive"),
    "infinite frequency": (lambda: npz(fs=np.inf, q_m=np.ones(3)), "fs|finite and positive"),
}
TEXTS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "blank lines": (b"\n\n\n", "is empty"),
    "header only": (b"t,q_m\n", "has a header but no samples"),
    "one sample": (b"t,q_m\n0,1\n", "sample"),
    "null bytes": (b"t,q_m\n0,1\n\x00\x00\n", "line 3|cannot be read|null"),
    "binary": (bytes(range(256)), "cannot be read|line|column"),
    "pickle": (PICKLE, "cannot be read|line|empty|column"),
    "ragged": (b"t,q_m\n0,1\n1\n", "line 3: has 1 cells, the header has 2"),
    "a word": (b"t,q_m\n0,1\n1,x\n", "line 3, column q_m: is 'x', no number"),
    "code": (b"t,q_m\n0,1\n1,open('pwned'\n", "line 3, column q_m: is .* no number"),
    "formula": (b"t,q_m\n0,1\n1,=1+1\n", "line 3, column q_m: is '=1\\+1', no number"),
    "empty cell": (b"t,q_m\n0,1\n1,\n", "column q_m, sample 1: is nan"),
    "not a number": (b"t,q_m\n0.000,1\n0.001,nan\n0.002,1\n", "column q_m, sample 1: is nan"),
    "infinity": (b"t,q_m\n0.000,1\n0.001,inf\n0.002,1\n", "column q_m, sample 1: is inf"),
    "overflow": (b"t,q_m\n0.000,1\n0.001,1e999\n0.002,1\n", "column q_m, sample 1: is inf"),
    "underscore": (b"t,q_m\n0,1\n1,1_0\n2,1\n", "no number"),
    "column twice": (b"t,q_m,q_m\n0,1,2\n", "two columns are named q_m"),
    "no names": (b"0,1\n1,2\n", "holds numbers, not column names"),
    "unnamed column": (b"t,\n0,1\n", "has no name"),
    "clock stands still": (b"t,q_m\n1,1\n1,2\n1,3\n", "does not increase|t"),
    "clock runs back": (b"t,q_m\n2,1\n1,2\n0,3\n", "backward|increase|t"),
    "clock jumps": (b"t,q_m\n0,1\n1,2\n2,3\n50,4\n51,5\n", "gap|uniform|uneven|t"),
    "damaged mark": (b'# modelgen record {"fs": \nt,q_m\n0,1\n1,2\n', MARK),
    "mark of another type": (
        b"# modelgen record []\nt,q_m\n0,1\n1,2\n",
        "line 1: is a damaged record header",
    ),
    "deep mark": (
        b"# modelgen record " + b"[" * 100_000 + b"\nt,q_m\n0,1\n",
        "line 1: is a damaged record header",
    ),
    "frequency that is no number": (
        b'# modelgen record {"fs": NaN, "name": "a", "tag": null}\nt,q_m\n0,1\n1,2\n',
        MARK,
    ),
    "open quote": (b't,q_m\n0,"1\n1,2\n2,3\n', "line|column|cannot be read"),
    "utf-16 cut short": ("t,q_m\n0,1\n".encode("utf-16")[:-1], "cannot be read|line|samples|sample"),
}
OTHERS = {
    "mat: empty": ("a.mat", lambda: b"", "is empty"),
    "mat: text": ("a.mat", lambda: b"q_m = [1 2 3];", "is no readable MATLAB file"),
    "mat: pickle": ("a.mat", lambda: PICKLE, "is no readable MATLAB file"),
    "mat: truncated": ("a.mat", lambda: mat_bomb()[:1000], "is no readable MATLAB file"),
    "mat: bomb": ("a.mat", mat_bomb, "unpacks from .* bytes to .* MB or more"),
    "mat: 7.3 in name only": (
        "a.mat",
        lambda: b"MATLAB 7.3 MAT-file" + bytes(600),
        "no readable HDF5 file|h5py",
    ),
    "hdf5: text": ("a.h5", lambda: b"not HDF5 at all", "is no readable HDF5 file|h5py"),
    "parquet: text": ("a.parquet", lambda: b"PAR1 not at all PAR1", "is no readable Parquet file|pyarrow"),
    "mdf: text": ("a.mf4", lambda: b"not MDF at all", "is no readable|asammdf"),
    "tdms: text": ("a.tdms", lambda: b"TDSm" + bytes(50), "is no readable|npTDMS|nptdms|no column|channels"),
    "unknown suffix": ("a.pkl", lambda: PICKLE, "has the suffix '.pkl'"),
    "joblib": ("a.joblib", lambda: PICKLE, "has the suffix '.joblib'"),
    "npy": ("a.npy", lambda: PICKLE, "has the suffix '.npy'"),
    "no suffix": ("data", lambda: PICKLE, "has no suffix"),
}


@pytest.fixture
def low_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Count from 1 MB as a bomb: the real limit takes seconds to reach."""
    monkeypatch.setattr("modelgen.runtime.files.size_limits.ALWAYS_FINE", 1_000_000)


@pytest.mark.parametrize("name", ARCHIVES)
def test_a_hostile_archive(trap: Path, name: str, low_limit: None) -> None:
    make, message = ARCHIVES[name]
    refused(trap / "a.npz", make(), message)


@pytest.mark.parametrize("name", TEXTS)
def test_a_hostile_table(trap: Path, name: str) -> None:
    content, message = TEXTS[name]
    refused(trap / "a.csv", content, message)


@pytest.mark.parametrize("name", OTHERS)
def test_a_hostile_file_of_another_format(trap: Path, name: str, low_limit: None) -> None:
    file, make, message = OTHERS[name]
    refused(trap / file, make(), message)


PLACES = {
    "absent": "absent.csv",
    "folder": "folder.csv",
    "null byte": "a\x00.csv",
    "too long": "a" * 5000 + ".csv",
}


@pytest.mark.parametrize("name", PLACES)
def test_a_path_that_is_no_file(trap: Path, name: str) -> None:
    (trap / "folder.csv").mkdir()
    with pytest.raises(DataError, match="cannot be read"):
        read_record(trap / PLACES[name])


def refused(path: Path, content: bytes, message: str) -> None:
    """Read a file; it must be refused by a message that names it, and be left as it was."""
    path.write_bytes(content)
    with pytest.raises(DataError, match=message) as caught:
        read_record(path)
    assert path.stem in str(caught.value)
    # no advice to trust what is in it, and the same words every time
    assert not re.search("allow_pickle|trust| at 0x", str(caught.value))
    assert path.read_bytes() == content
