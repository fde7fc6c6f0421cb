"""Elements of a MATLAB file of level 5 (versions 5 to 7) -> arrays, texts, structures and cells.

Whatever an element states (its length, its dimensions, how many fields follow) is compared with the bytes
that are there before anything is made of it, so that a damaged file raises `DamagedFile` and nothing else.
The format: MathWorks, MAT-File Format, chapter 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from struct import unpack_from
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.runtime.files.size_limits import LONGEST_NAME, MOST_COLUMNS

MATRIX, COMPRESSED = 14, 15
_INT8, _UINT8, _INT32, _UINT32, _UTF8 = 1, 2, 5, 6, 16
# how numbers are stored; an array of doubles may be stored in a smaller type that holds its values
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CODECS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
CELL, STRUCT, CHAR, OPAQUE = 1, 2, 4, 17
NUMERIC = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
LEFT_OUT = {3: "an object", 5: "sparse", 16: "a function", OPAQUE: "an object"}
COMPLEX_FLAG = 0x800
MOST_DIMENSIONS = 32
DEEPEST = 16  # structures and cells within each other
MOST_PARTS = 15 * MOST_COLUMNS  # elements of one structure or cell: so many fields of every trace

Text = str
Fields = dict[str, list[Any]]  # of a structure: a field's value in each of its entries


class DamagedFile(ValueError):
    """What is wrong with a file that cannot be read."""


@dataclass(frozen=True)
class ArrayHead:
    """The head of an array: its name, class and shape."""

    name: str
    kind: int
    shape: tuple[int, ...]
    is_complex: bool = False

    @property
    def size(self) -> int:
        """Number of values."""
        return prod(self.shape)


class Elements:
    """The elements in a stretch of bytes, one after the other; none reaches beyond it."""

    def __init__(self, data: memoryview, order: str) -> None:
        self.data, self.order, self.place = data, order, 0

    def next(self, *kinds: int) -> tuple[int, memoryview]:
        """Return the kind and bytes of the next element, which must be of one of these kinds (if any)."""
        left = len(self.data) - self.place
        if left < 8:
            raise DamagedFile("it ends within an array")
        kind, size = unpack_from(f"{self.order}II", self.data, self.place)
        start = self.place + 8
        if kind >> 16:  # the tag itself holds up to four bytes
            kind, size, start = kind & 0xFFFF, kind >> 16, self.place + 4
        if size > len(self.data) - start or (start == self.place + 4 and size > 4):
            raise DamagedFile(f"an element states {size} bytes, {len(self.data) - start} are there")
        if kinds and kind not in kinds:
            raise DamagedFile(f"an element is of type {kind}, not {kinds[0]}")
        self.place = min(len(self.data), start + size + -(start + size - self.place) % 8)
        return kind, self.data[start : start + size]

    def head(self) -> ArrayHead:
        """Return what stands before an array's values."""
        _, flags = self.next(_UINT32)
        if len(flags) != 8:
            raise DamagedFile("an array has no flags")
        (word,) = unpack_from(f"{self.order}I", flags)
        kind = word & 0xFF
        shape: tuple[int, ...] = ()
        if kind != OPAQUE:
            _, sizes = self.next(_INT32)
            if len(sizes) % 4 or not 8 <= len(sizes) <= 4 * MOST_DIMENSIONS:
                raise DamagedFile(f"an array states its dimensions in {len(sizes)} bytes")
            shape = unpack_from(f"{self.order}{len(sizes) // 4}i", sizes)
        if any(length < 0 for length in shape):
            raise DamagedFile(f"an array has the dimensions {shape}")
        _, name = self.next(_INT8, _UINT8, _UTF8)
        return ArrayHead(name_of(name), kind, shape, bool(word & COMPLEX_FLAG))


def name_of(data: memoryview) -> str:
    """Return the name of a variable or field."""
    if len(data) > LONGEST_NAME:
        raise DamagedFile(f"a name takes {len(data)} bytes")
    name = bytes(data).partition(b"\0")[0].decode("latin-1")
    if not name.isprintable():
        raise DamagedFile(f"a name is {name!r}")
    return name


class VariableValues:
    """The values of one variable, decoded; `order` is "<" or ">"."""

    def __init__(self, order: str) -> None:
        self.order, self.parts = order, 0

    def array(self, data: memoryview, depth: int = 0) -> Any:
        """Return what an element holds: an array of numbers, a Text, Fields, a list (a cell), or None."""
        self.parts += 1
        if depth > DEEPEST or self.parts > MOST_PARTS:
            raise DamagedFile("it holds structures too deep or too large to be a recording")
        if not len(data):  # how MATLAB writes an empty array within a structure
            return np.empty((0, 0))
        elements = Elements(data, self.order)
        head = elements.head()
        if head.kind in NUMERIC:
            return self._numbers(elements, head)
        if head.kind == CHAR:
            return self._text(elements, head)
        if head.kind == STRUCT:
            return self._fields(elements, head, depth)
        if head.kind == CELL:
            self._check_count(elements, head.size)
            return [self.array(elements.next(MATRIX)[1], depth + 1) for _ in range(head.size)]
        return None

    def _numbers(self, elements: Elements, head: ArrayHead) -> npt.NDArray[Any]:
        if head.size == 0:
            return np.empty(0, NUMERIC[head.kind])
        values = self._part(elements, head)
        if head.is_complex:
            values = complex_of(values, self._part(elements, head))
        return values.reshape(head.shape, order="F")

    def _part(self, elements: Elements, head: ArrayHead) -> npt.NDArray[Any]:
        kind, data = elements.next(*_STORED)
        stored = np.dtype(self.order + _STORED[kind])
        wanted = np.dtype(NUMERIC[head.kind])
        if len(data) != head.size * stored.itemsize:
            what = f"an array of {head.size} numbers has {len(data)} bytes of type {stored.name}"
            raise DamagedFile(what)
        if stored.kind == "f" and wanted.kind != "f":
            raise DamagedFile(f"an array of {wanted.name} is stored as {stored.name}")
        with np.errstate(over="ignore", invalid="ignore"):  # of doubles in an array of singles
            return np.frombuffer(data, stored).astype(wanted, copy=False)

    def _text(self, elements: Elements, head: ArrayHead) -> Text:
        if head.size == 0:
            return ""
        kind, data = elements.next(*_CODECS)
        codec = _CODECS[kind]
        if codec in ("utf-16", "utf-32"):
            codec += "-le" if self.order == "<" else "-be"
        text = bytes(data).decode(codec, errors="replace")
        rows = head.shape[0]  # of several lines the letters stand column by column
        return "".join(text[row::rows] for row in range(rows)) if 1 < rows <= len(text) else text

    def _fields(self, elements: Elements, head: ArrayHead, depth: int) -> Fields:
        names = field_names(elements)
        self._check_count(elements, head.size * len(names))
        fields: Fields = {name: [] for name in names}
        for _ in range(head.size):
            for name in names:
                fields[name].append(self.array(elements.next(MATRIX)[1], depth + 1))
        return fields

    def _check_count(self, elements: Elements, count: int) -> None:
        there = (len(elements.data) - elements.place) // 8
        if count > there:
            raise DamagedFile(f"a structure or cell states {count} parts, at most {there} are there")


def complex_of(real: npt.NDArray[Any], imaginary: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return complex numbers of parts of one shape, in their unit; a sum with 1j would make NaN of inf."""
    values = np.empty(real.shape, np.result_type(real, np.complex64))
    values.real, values.imag = real, imaginary
    return values


def field_names(elements: Elements) -> list[str]:
    """Return the names of a structure's fields, which follow its head."""
    _, stated = elements.next(_INT32)
    length = unpack_from(f"{elements.order}i", stated)[0] if len(stated) == 4 else 0
    _, table = elements.next(_INT8, _UINT8, _UTF8)
    if not 0 < length <= LONGEST_NAME or len(table) % length:
        raise DamagedFile(f"a structure has field names of {length} bytes in {len(table)}")
    return list(dict.fromkeys(name_of(table[k : k + length]) for k in range(0, len(table), length)))
