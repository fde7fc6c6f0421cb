"""Calls of a reading process (`reader_child`) about an HDF5 file; only there is h5py ever imported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from modelgen.runtime.files.size_limits import MOST_COLUMNS

NUMERIC = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.ENUM)  # of which truth values are one
DEEPEST = 100  # groups within each other: names of places cost the square of it
UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units")


def listing(path: Path) -> Iterator[Any]:
    """Yield a list of the numeric data sets, {"name", "shape", "bytes", "unit", "elsewhere", "value"}, and
    the attributes of the file that are single numbers; of too many data sets one more than are allowed.

    The low level of h5py is used: its objects take ten times as long.
    """
    found: list[dict[str, Any]] = []

    def visit(name: bytes, info: Any) -> bool | None:
        if name.count(b"/") > DEEPEST:
            raise ValueError(f"its groups are nested more than {DEEPEST} deep")
        # MATLAB keeps the inside of its objects and cells in #refs#
        if info.type != h5py.h5o.TYPE_DATASET or name.startswith(b"#"):
            return None
        facts = _facts(h5py.h5d.open(file.id, name))
        found.extend([{"name": name.decode("utf-8", "surrogateescape"), **facts}] if facts else [])
        return True if len(found) > MOST_COLUMNS else None  # which ends the visit

    with h5py.File(path, "r") as file:
        h5py.h5o.visit(file.id, visit, info=True)
        numbers = {
            key: float(value)
            for key, value in file.attrs.items()
            if isinstance(value, (int, float, np.integer, np.floating))
        }
    yield found
    yield numbers


def _facts(item: Any) -> dict[str, Any] | None:
    """Return what is to be known of a data set, None of one that holds no numbers."""
    kind, shape = item.get_type(), item.shape
    if kind.get_class() not in NUMERIC or item.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        return None
    unit = None
    if h5py.h5a.get_num_attrs(item):
        attributes = h5py.Dataset(item).attrs
        # texts are arrays of char there
        if attributes.get("MATLAB_class") in (b"char", b"logical"):
            return None
        stated = next((attributes[key] for key in UNIT_ATTRIBUTES if key in attributes), None)
        if stated is not None:
            unit = stated.decode() if isinstance(stated, bytes) else str(stated)
    made = item.get_create_plist()
    elsewhere = made.get_external_count() > 0 or made.get_layout() == h5py.h5d.VIRTUAL
    size = prod(shape)
    number = size == 1 and not elsewhere and kind.get_class() != h5py.h5t.ENUM
    return {
        "shape": shape,
        "bytes": size * kind.get_size(),
        "unit": unit,
        "elsewhere": elsewhere,
        "value": float(_whole(item).item()) if number else None,
    }


def _whole(item: Any) -> npt.NDArray[Any]:
    values = np.empty(item.shape, item.dtype)
    if values.size:
        item.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
    return values


def columns(path: Path, names: Sequence[str]) -> Iterator[Any]:
    """Yield the whole of each of these data sets."""
    with h5py.File(path, "r") as file:
        for name in names:
            yield _whole(h5py.h5d.open(file.id, name.encode("utf-8", "surrogateescape")))


def lengths(path: Path, names: Sequence[str]) -> Iterator[Any]:
    """Yield the length of each of these data sets, None for one that is not there."""
    with h5py.File(path, "r") as file:
        for name in names:
            yield len(file[name]) if name in file else None


def stretch(path: Path, name: str, start: int, stop: int) -> Iterator[Any]:
    """Yield samples start to stop of a data set."""
    with h5py.File(path, "r") as file:
        yield np.asarray(file[name][start:stop])
