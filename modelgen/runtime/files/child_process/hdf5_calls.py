"""Calls of a reading process (`reader_child`) about an HDF5 file; only there is h5py ever imported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from modelgen.runtime.files.size_limits import LONGEST_NAME, MOST_COLUMNS

NUMERIC = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.ENUM)  # of which truth values are one
DEEPEST = 100  # groups within each other: names of places cost the square of it
DEEPEST_CELLS = 16  # within each other, as of older versions
MOST_REFERENCES = 15 * MOST_COLUMNS  # so many fields of every trace
UNIT_ATTRIBUTES = ("unit", "units")  # in any case


def listing(path: Path) -> Iterator[Any]:
    """Yield the numeric data sets, the attributes of the file that are single numbers, and what is left out.

    A data set is {"name", "place", "shape", "bytes", "unit", "elsewhere", "value"}; of too many one more than
    are allowed is listed. The low level of h5py is used: its objects take ten times as long.
    """
    with h5py.File(path, "r") as file:
        parts = _Parts(file.id)
        parts.of_group(file.id, "", 0)
        numbers = {
            key: float(value)
            for key, value in file.attrs.items()
            if isinstance(value, (int, float, np.integer, np.floating))
        }
    yield parts.found
    yield numbers
    yield parts.left_out


class _Parts:
    """The data sets of a file, and those that the cells and arrays of structures of MATLAB refer to."""

    def __init__(self, file: Any) -> None:
        self.file = file
        self.found: list[dict[str, Any]] = []
        self.left_out: list[str] = []
        self.followed = 0

    def of_group(self, group: Any, prefix: str, depth: int) -> None:
        """List what a group holds, under names that begin with the prefix."""

        def visit(name: bytes, info: Any) -> bool | None:
            if name.count(b"/") > DEEPEST:
                raise ValueError(f"its groups are nested more than {DEEPEST} deep")
            # MATLAB keeps the inside of its objects and cells in #refs#
            if info.type == h5py.h5o.TYPE_DATASET and not name.startswith(b"#"):
                told = prefix + name.decode("utf-8", "backslashreplace").replace("/", ".")
                self.of_data_set(h5py.h5d.open(group, name), told, depth)
            return True if len(self.found) > MOST_COLUMNS else None  # which ends the visit

        h5py.h5o.visit(group, visit, info=True)

    def of_data_set(self, item: Any, name: str, depth: int) -> None:
        """List a data set, or what it refers to."""
        attributes = h5py.Dataset(item).attrs if h5py.h5a.get_num_attrs(item) else {}
        if "MATLAB_object_decode" in attributes:
            self.left_out.append(f"{name} (an object)")
        elif _refers(item):
            self._of_references(item, name, depth + 1, attributes.get("MATLAB_class") == b"cell")
        elif "MATLAB_empty" not in attributes:  # its numbers are its shape
            facts = _facts(item)
            if facts is not None:
                place = h5py.h5i.get_name(item).decode("utf-8", "surrogateescape")
                self.found.append({"name": name, "place": place, **facts})

    def _of_references(self, item: Any, name: str, depth: int, is_cell: bool) -> None:
        """List a cell as "c{2}", a field of several structures as "s(2).values", or by its label."""
        if depth > DEEPEST_CELLS:
            raise ValueError(f"its cells are nested more than {DEEPEST_CELLS} deep")
        self.followed += prod(item.shape)
        if self.followed > MOST_REFERENCES:
            raise ValueError(f"its cells have more than {MOST_REFERENCES} entries")
        whole, _, part = name.rpartition(".")
        labels = [] if is_cell or part != "values" else self._labels(item)
        several = prod(item.shape) > 1
        for k, reference in enumerate(_whole(item).ravel()):
            if is_cell:
                told = f"{name}{{{k + 1}}}"
            elif labels:
                told = f"{whole}.{labels[k]}"
            else:
                told = f"{whole}({k + 1}).{part}" if several and whole else name
            target = h5py.h5r.dereference(reference, self.file) if reference else None
            if isinstance(target, h5py.h5d.DatasetID):
                self.of_data_set(target, told, depth)
            elif isinstance(target, h5py.h5g.GroupID):
                self.of_group(target, f"{told}.", depth)

    def _labels(self, values: Any) -> list[str]:
        """Return the texts of "label" next to "values", as Simulink writes them, if they are names."""
        group = h5py.h5o.open(self.file, h5py.h5i.get_name(values).rpartition(b"/")[0] or b"/")
        # no link into another file is followed
        if b"label" not in group or group.links.get_info(b"label").type != h5py.h5l.TYPE_HARD:
            return []
        item = h5py.h5o.open(group, b"label")
        if not _refers(item) or item.shape != values.shape:
            return []
        texts = [_text(h5py.h5r.dereference(r, self.file)) if r else "" for r in _whole(item).ravel()]
        plain = all(texts) and len(set(texts)) == len(texts) and "".join(texts).isprintable()
        return texts if plain else []


def _refers(item: Any) -> bool:
    """Return whether something is a data set of references."""
    return isinstance(item, h5py.h5d.DatasetID) and item.get_type().equal(h5py.h5t.STD_REF_OBJ) > 0


def _text(item: Any) -> str:
    """Return a text of MATLAB, an array of code units, or "" for what is none."""
    if not isinstance(item, h5py.h5d.DatasetID) or prod(item.shape) > LONGEST_NAME:
        return ""
    if (
        h5py.Dataset(item).attrs.get("MATLAB_class") != b"char"
        or item.get_type().get_class() != h5py.h5t.INTEGER
    ):
        return ""
    return "".join(map(chr, _whole(item).astype("u2").ravel()))


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
        stated = next((attributes[key] for key in attributes if key.lower() in UNIT_ATTRIBUTES), None)
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


def columns(path: Path, places: Sequence[str]) -> Iterator[Any]:
    """Yield the whole of each of these data sets."""
    with h5py.File(path, "r") as file:
        for name in places:
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
