"""MATLAB files with bytes, lengths, types and whole elements changed: columns or a message, nothing else."""

from __future__ import annotations

import io
import random
import tracemalloc
import zlib
from pathlib import Path
from struct import pack, pack_into, unpack_from

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source

T = np.arange(60) / 1000.0
MUTANTS = 1500
WORDS = (0, 1, 2, 4, 7, 8, 14, 15, 16, 17, 127, 128, 255, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 8, 2**32 - 1)


def traces() -> dict[str, object]:
    X = np.zeros((1,), dtype=[("Name", "O"), ("Data", "O")])
    X[0] = ("", T)
    Y = np.zeros((3,), dtype=[("Name", "O"), ("Unit", "O"), ("Data", "O")])
    for place, name in enumerate(("theta", "torque", "acc")):
        Y[place] = (f'Model Root/"{name}"', "deg", np.sin(T))
    return {"X": X, "Y": Y, "Description": "run"}


def good_files() -> list[bytes]:
    """Return files of both levels, packed and not, with everything that the reader knows."""
    from scipy.io import savemat
    from scipy.sparse import eye

    cell = np.empty(2, dtype=object)
    cell[:] = [np.arange(3), "text"]
    plain = {"q_m": np.sin(T), "F": T.astype("f4"), "i": np.arange(60, dtype="i2"), "fs": 1000.0}
    mixed = {**plain, "z": T * 1j, "on": T > 0.03, "text": "°", "c": cell, "s": {"a": {"b": T}}, "e": []}
    files = []
    for values in (plain, {**mixed, "S": eye(3, format="csc")}, {"recording": traces(), "fs": 1.0}):
        for packed in (False, True):
            content = io.BytesIO()
            savemat(content, values, do_compression=packed)
            files.append(content.getvalue())
    content = io.BytesIO()
    savemat(content, {**plain, "z": T * 1j}, format="4")
    return [*files, content.getvalue()]


def tags(content: bytes) -> list[int]:
    """Return where tags of elements may stand: small numbers in the first word, at places divided by four."""
    return [k for k in range(0, len(content) - 8, 4) if 0 < unpack_from("<I", content, k)[0] % 65536 < 19]


def repacked(content: bytes, change: random.Random) -> bytes:
    """Return a file with one packed variable changed inside and packed again, so that its sum is right."""
    place, pieces = 128, [content[:128]]
    while place + 8 <= len(content):
        kind, size = unpack_from("<II", content, place)
        body = content[place + 8 : place + 8 + size]
        if kind == 15 and change.random() < 0.5:
            body = zlib.compress(changed(zlib.decompress(body), change))
        pieces.append(pack("<II", kind, len(body)) + body)
        place += 8 + size
    return b"".join(pieces)


def changed(content: bytes, change: random.Random) -> bytes:
    """Return a file with a few bytes, words, tags or stretches changed, cut out or put elsewhere."""
    data = bytearray(content)
    for _ in range(change.choice((1, 1, 2, 4))):
        place = change.randrange(len(data)) if data else 0
        kind = change.randrange(7)
        if kind == 0 and data:
            data[place] = change.choice((0, 1, 15, 255, data[place] ^ 1 << change.randrange(8)))
        elif kind in (1, 2):
            place = change.choice(tags(bytes(data)) or [0]) + 4 * change.randrange(2)
            if place + 4 <= len(data):
                order = change.choice("<>")
                pack_into(f"{order}I", data, place, change.choice((*WORDS, len(data), len(data) - place)))
        elif kind == 3:
            del data[place : place + change.choice((1, 8, 64, len(data)))]
        elif kind == 4:
            data[place:place] = change.randbytes(change.choice((1, 8, 64)))
        elif kind == 5:
            start = change.choice(tags(bytes(data)) or [0])
            data[place:place] = data[start : start + 8 * change.randrange(1, 40)]
        else:
            del data[place:]
    return bytes(data)


def mutant(files: list[bytes], seed: int) -> bytes:
    change = random.Random(seed)
    content = change.choice(files)
    packed = content[128:132] == b"\x0f\0\0\0"
    return repacked(content, change) if packed and change.random() < 0.7 else changed(content, change)


def read_all(path: Path) -> bool:
    """Read every column of a file, and say whether it was read at all."""
    try:
        source = open_source(path)
        columns = source.load(source.names)
    except DataError as error:
        assert str(path) in str(error)
        assert str(error).isprintable()
        return False
    assert all(column.ndim == 1 and column.dtype.kind in "biufc" for column in columns.values())
    assert all(isinstance(value, float) for value in source.scalars.values())
    return True


@pytest.mark.slow
def test_mutated_files_are_read_or_refused(trap: Path) -> None:
    files = good_files()
    path = trap / "a.mat"
    for content in files:
        path.write_bytes(content)
        assert read_all(path)
    tracemalloc.start()
    try:
        refused = 0
        for seed in range(MUTANTS):
            path.write_bytes(mutant(files, seed))
            refused += not read_all(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert MUTANTS // 10 < refused < MUTANTS
    assert peak < 20_000_000  # the largest of the files takes 11 kB


SPARSE = {10_000_000_000: "is larger than 8000 MB", 7_000_000_000: "states 7000 MB, of which hardly any"}


@pytest.mark.parametrize("size", SPARSE)
@pytest.mark.parametrize("level", [4, 5])
def test_gigabytes_of_zeros(trap: Path, level: int, size: int) -> None:
    path = trap / "a.mat"
    with path.open("wb") as file:
        if level == 5:
            file.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
        file.truncate(size)
    with pytest.raises(DataError, match=SPARSE[size]):
        open_source(path)


@pytest.mark.parametrize("level", [4, 5])
def test_megabytes_of_zeros(trap: Path, level: int) -> None:
    path = trap / "a.mat"
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" if level == 5 else b""
    path.write_bytes(head + bytes(20_000_000))
    with pytest.raises(DataError, match="is no readable MATLAB file"):
        open_source(path)


def nested(depth: int) -> bytes:
    flags, shape = pack("<4I", 6, 8, 2, 0), pack("<2I2i", 5, 8, 1, 1)
    body = b""
    for name in (b"Y", *[b"X"] * depth):
        names = pack("<2H4s", 5, 4, pack("<i", 2)) + pack("<2I", 1, 4) + b"X\0Y\0" + bytes(4)
        fields = pack("<2I", 14, len(body)) + body + pack("<2I", 14, 0)
        body = flags + shape + pack("<2H4s", 1, 1, name) + names + fields
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + pack("<2I", 14, len(body)) + body


def test_structures_within_each_other_end(trap: Path) -> None:
    (trap / "a.mat").write_bytes(nested(5000))
    with pytest.raises(DataError, match="structures too deep"):
        open_source(trap / "a.mat")


def test_a_packed_variable_that_states_more_than_it_holds(trap: Path) -> None:
    flags, shape = pack("<4I", 6, 8, 6, 0), pack("<2I2i", 5, 8, 10_000_000, 1)
    body = flags + shape + pack("<2H4s", 1, 1, b"q") + pack("<2I", 9, 80_000_000)
    packed = zlib.compress(pack("<2I", 14, len(body) + 80_000_000) + body)
    path = trap / "a.mat"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + pack("<2I", 15, len(packed)) + packed)
    tracemalloc.start()
    try:
        with pytest.raises(DataError, match="unpacks to another length"):
            open_source(path).load(("q",))
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
