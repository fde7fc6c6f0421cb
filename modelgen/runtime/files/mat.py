"""MATLAB files of level 4 and 5 (versions 4 to 7): which variables they hold, and the values of one.

modelgen has its own reader: SciPy's is compiled, and a few changed bytes can crash the process. Here the
listing reads the head of every variable only; version 7.3 is HDF5 (`child_process.hdf5`).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from struct import unpack, unpack_from
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from modelgen.read_file import DATA, open_file
from modelgen.runtime.files.mat_elements import (
    CELL,
    COMPRESSED,
    LEFT_OUT,
    MATRIX,
    NUMERIC,
    STRUCT,
    DamagedFile,
    Elements,
    VariableValues,
    complex_of,
    field_names,
    name_of,
)
from modelgen.runtime.files.size_limits import LONGEST_NAME, check_columns, check_expansion

HEADER = 128  # bytes in front of the first variable, level 5
HEAD = 8192  # bytes that hold the head of a variable, unpacked or not
# level 4: the type of the numbers by the third digit of a variable's first word
_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_LEVEL4 = {0: "", 1: "other", 2: "sparse"}  # by the fourth digit: numbers, a text, a sparse matrix


@dataclass(frozen=True)
class Variable:
    """A variable: its shape, what it is (a type of numbers, "struct" or a word), and where it stands."""

    name: str
    shape: tuple[int, ...]
    what: str
    place: int
    size: int
    is_complex: bool = False
    packed: bool = False
    fields: tuple[str, ...] = ()

    @property
    def is_numeric(self) -> bool:
        """Whether its values are numbers."""
        return self.what[-1].isdecimal()

    @property
    def holds_others(self) -> bool:
        """Whether arrays may stand within it: a structure, a cell."""
        return bool(self.fields) or self.what == "a cell"


@dataclass(frozen=True)
class MatFile:
    """A file and its variables; `order` is "<" or ">", `repeated` names variables stored several times."""

    path: Path
    level: int
    order: str
    variables: dict[str, Variable] = field(default_factory=dict)
    repeated: tuple[str, ...] = ()

    def value(self, name: str) -> Any:
        """Return the values of a variable.

        Raises
        ------
        DamagedFile
            When they are not what the variable's head says.
        """
        variable = self.variables[name]
        with open_file(self.path, DATA) as file:
            file.seek(variable.place)
            data = file.read(variable.size)
        if self.level == 4:
            return _level4_value(variable, data)
        if variable.packed:
            data = _unpacked(data, self.order)
        return VariableValues(self.order).array(memoryview(data))


def open_variables(path: Path) -> MatFile:
    """Return the variables of a file without their values.

    Raises
    ------
    DamagedFile
        When it is no MATLAB file of level 4 or 5, or the head of a variable is damaged.
    DataError
        When it unpacks to far more than its size, or holds too many variables.
    """
    with open_file(path, DATA) as file:
        start = file.read(HEADER)
        mark = start[126:128]
        if 0 in start[:4]:  # level 5 begins with a text, level 4 with the type of the first variable
            level, order, found = 4, "<", _level4(file)
        elif mark in (b"IM", b"MI"):
            level, order = 5, "<" if mark == b"IM" else ">"
            found = _level5(file, order)
        else:
            raise DamagedFile("it has no header of one")
        variables: dict[str, Variable] = {}
        repeated: dict[str, None] = {}
        unpacked = 0
        for number, (variable, size) in enumerate(found, start=1):
            unpacked += size
            check_expansion(path, unpacked)
            check_columns(path, number)
            if variable.name in variables:
                repeated[variable.name] = None
            if variable.name:  # what has none is MATLAB's own
                variables[variable.name] = variable
    return MatFile(path, level, order, variables, tuple(repeated))


def _level5(file: BinaryIO, order: str) -> Iterator[tuple[Variable, int]]:
    """Yield every variable and the bytes that it takes unpacked."""
    end = file.seek(0, 2)
    place = HEADER
    while place < end:
        file.seek(place)
        tag = file.read(8)
        kind, size = unpack(f"{order}II", tag) if len(tag) == 8 else (0, 0)
        if kind not in (MATRIX, COMPRESSED) or size > end - place - 8 or not size:
            raise DamagedFile(f"no whole variable stands at byte {place}")
        head = file.read(min(size, HEAD))
        packed = kind == COMPRESSED
        if packed:
            head, unpacked = _packed_head(head, order)
        else:
            unpacked = size
        yield _variable(head, order, place + 8, size, packed), unpacked
        place += 8 + size


def _packed_head(packed: bytes, order: str) -> tuple[bytes, int]:
    """Return the first bytes of a packed variable and how many it states there are."""
    try:
        head = zlib.decompressobj().decompress(packed, HEAD)
    except zlib.error as error:
        raise DamagedFile(f"a variable cannot be unpacked: {error}") from error
    kind, size = unpack_from(f"{order}II", head) if len(head) >= 8 else (0, 0)
    if kind != MATRIX:
        raise DamagedFile(f"a packed element is of type {kind}, not {MATRIX}")
    return head[8:], size


def _unpacked(packed: bytes, order: str) -> bytes:
    """Return a packed variable, which must have the length that it states."""
    unpacker = zlib.decompressobj()
    try:
        tag = unpacker.decompress(packed, 8)
        size = unpack(f"{order}II", tag)[1] if len(tag) == 8 else 0
        data = unpacker.decompress(unpacker.unconsumed_tail, size + 1)
    except (zlib.error, OverflowError) as error:
        raise DamagedFile(f"a variable cannot be unpacked: {error}") from error
    if len(data) != size or not unpacker.eof:
        raise DamagedFile(f"a variable states {size} bytes and unpacks to another length")
    return data


def _variable(head: bytes, order: str, place: int, size: int, packed: bool) -> Variable:
    elements = Elements(memoryview(head), order)
    found = elements.head()
    fields: tuple[str, ...] = ()
    words = {**LEFT_OUT, CELL: "a cell"}
    what = NUMERIC.get(found.kind) or words.get(found.kind, "other")
    if found.kind == STRUCT:
        fields = _first_fields(elements)
    return Variable(found.name, found.shape, what, place, size, packed=packed, fields=fields)


def _first_fields(elements: Elements) -> tuple[str, ...]:
    """Return the fields of a structure; of one with so many that they go beyond its head, none."""
    try:
        return tuple(field_names(elements))
    except DamagedFile:
        return ()


def _level4(file: BinaryIO) -> Iterator[tuple[Variable, int]]:
    """Yield every variable and the bytes that it takes."""
    end = file.seek(0, 2)
    place = 0
    while place < end:
        file.seek(place)
        head = file.read(20)
        if len(head) < 20:
            raise DamagedFile(f"no whole variable stands at byte {place}")
        order = "<" if 0 <= unpack("<i", head[:4])[0] < 10_000 else ">"
        kind, rows, columns, is_complex, length = unpack(f"{order}5i", head)
        swapped, digits = divmod(kind, 1000)
        stored, shape_kind = divmod(digits, 10)
        known = swapped == (order == ">") and stored < len(_TYPES) and shape_kind in _LEVEL4
        if not known or min(rows, columns) < 0 or is_complex not in (0, 1) or not 0 < length <= LONGEST_NAME:
            raise DamagedFile(f"no variable of level 4 stands at byte {place}")
        dtype = order + _TYPES[stored]
        size = rows * columns * np.dtype(dtype).itemsize * (1 + is_complex)
        start = place + 20 + length
        if start + size > end:
            raise DamagedFile(f"the variable at byte {place} states {size} bytes, {end - start} are there")
        what = _LEVEL4[shape_kind] or dtype
        name = name_of(memoryview(file.read(length)))
        yield Variable(name, (rows, columns), what, start, size, bool(is_complex)), size
        place = start + size


def _level4_value(variable: Variable, data: bytes) -> npt.NDArray[Any]:
    if len(data) != variable.size:
        raise DamagedFile("it has become shorter")
    values = np.frombuffer(data, variable.what)
    if variable.is_complex:
        values = complex_of(*np.split(values, 2))
    return values.astype(values.dtype.newbyteorder("="), copy=False).reshape(variable.shape, order="F")
