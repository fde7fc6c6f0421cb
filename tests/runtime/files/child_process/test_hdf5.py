"""MATLAB 7.3: cells, arrays of structures and objects, as MATLAB writes them in HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.cli.import_file import describe_file
from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.source import Source
from modelgen.runtime.records.read_record import read_record

N = 30
Q, U = np.sin(np.arange(N) / 3.0), np.cos(np.arange(N) / 3.0)


class MatFile:
    """A file of version 7.3 that is being written."""

    def __init__(self, file: Any, h5py: Any) -> None:
        self.file, self.h5py = file, h5py
        self.inner = file.create_group("#refs#")

    def numbers(self, values: Any) -> Any:
        """A matrix of numbers that something refers to."""
        item = self.inner.create_dataset(str(len(self.inner)), data=np.atleast_2d(values))
        item.attrs["MATLAB_class"] = np.bytes_("double")
        return item.ref

    def text(self, text: str) -> Any:
        """A text that something refers to."""
        codes = np.array([[ord(letter)] for letter in text], dtype="u2")
        item = self.inner.create_dataset(str(len(self.inner)), data=codes)
        item.attrs["MATLAB_class"] = np.bytes_("char")
        return item.ref

    def refers(self, place: str, references: list[Any], kind: str = "") -> Any:
        """A cell ("cell"), or a field of an array of structures."""
        table = np.array([[reference] for reference in references], dtype=self.h5py.ref_dtype)
        item = self.file.create_dataset(place, data=table)
        if kind:
            item.attrs["MATLAB_class"] = np.bytes_(kind)
        return item


def written(path: Path, fill: Any) -> Source:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(MatFile(file, h5py))
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    return open_source(path)


def test_what_a_cell_holds_is_named_by_its_place(tmp_path: Path) -> None:
    def fill(mat: MatFile) -> None:
        inner = mat.inner.create_group("s")
        inner["u"] = U[None, :]
        mat.refers("c", [mat.numbers(Q), mat.text("q_m"), inner.ref], "cell")

    assert written(tmp_path / "run.mat", fill).names == ("c{1}", "c{3}.u")
    record = read_record(tmp_path / "run.mat", {"q_m": "c{1}", "torque": "c{3}.u"}, fs=10.0)
    np.testing.assert_array_equal(record.signals["q_m"], Q)
    np.testing.assert_array_equal(record.signals["torque"], U)


def test_structures_by_number_and_signals_of_simulink_by_label(tmp_path: Path) -> None:
    def fill(mat: MatFile) -> None:
        mat.refers("rec/q", [mat.numbers(Q), mat.numbers(U)])
        mat.refers("out/signals/values", [mat.numbers(Q), mat.numbers(U)])
        mat.refers("out/signals/label", [mat.text("theta"), mat.text("torque")])

    source = written(tmp_path / "run.mat", fill)
    assert set(source.names) == {"rec(1).q", "rec(2).q", "out.signals.theta", "out.signals.torque"}
    np.testing.assert_array_equal(source.load(["rec(2).q"])["rec(2).q"], U)
    np.testing.assert_array_equal(source.load(["out.signals.theta"])["out.signals.theta"], Q)


def test_objects_and_empty_arrays_are_no_columns(tmp_path: Path) -> None:
    def fill(mat: MatFile) -> None:
        mat.file["ts"] = np.zeros((1, 6), dtype="u4")
        mat.file["ts"].attrs["MATLAB_object_decode"] = np.int32(3)
        mat.file["none"] = np.zeros(2, dtype="u8")
        mat.file["none"].attrs["MATLAB_empty"] = np.uint8(1)

    source = written(tmp_path / "run.mat", fill)
    assert (source.names, source.took) == ((), ("left out: ts (an object)",))
    with pytest.raises(DataError, match=r"no column of numbers \(left out: ts \(an object\)\); .*ts\.Time"):
        describe_file(tmp_path / "run.mat", None)


@pytest.mark.parametrize("others", [0, 30])
def test_cells_that_hold_themselves_end(tmp_path: Path, others: int) -> None:
    def fill(mat: MatFile) -> None:
        cell = mat.file.create_dataset("c", (1 + others, 1), dtype=mat.h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        cell[:] = np.array([[cell.ref]] * (1 + others), dtype=mat.h5py.ref_dtype)

    said = r"its cells (are nested more than 16 deep|have more than 150000 entries)"
    with pytest.raises(DataError, match=said):
        written(tmp_path / "run.mat", fill)
