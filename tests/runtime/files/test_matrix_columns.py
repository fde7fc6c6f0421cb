"""Matrices in files: every column can be chosen, in either language's way of counting, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.matrix_columns import MOST_SIDE, MatrixColumn, column_of_text, matrix_columns
from modelgen.runtime.records.read_record import read_record

N = 40
Y = np.random.default_rng(1).normal(size=(N, 3))
NAME = st.text(st.characters(exclude_categories=["Cc", "Cs", "Z"]), min_size=1, max_size=12)


def npz(path: Path, y: npt.NDArray[np.float64]) -> Path:
    np.savez(path.with_suffix(".npz"), y=y, u=np.arange(float(N)), fs=100.0)
    return path.with_suffix(".npz")


def mat(path: Path, y: npt.NDArray[np.float64]) -> Path:
    savemat(path.with_suffix(".mat"), {"y": y, "u": np.arange(float(N)), "fs": 100.0})
    return path.with_suffix(".mat")


def mat4(path: Path, y: npt.NDArray[np.float64]) -> Path:
    savemat(path.with_suffix(".mat"), {"y": y, "u": np.arange(float(N)), "fs": 100.0}, format="4")
    return path.with_suffix(".mat")


def mat73(path: Path, y: npt.NDArray[np.float64]) -> Path:
    h5py = pytest.importorskip("h5py")
    path = path.with_suffix(".mat")
    with h5py.File(path, "w", userblock_size=512) as file:
        file["y"], file["u"], file["fs"] = y.T, np.arange(float(N))[None, :], np.array([[100.0]])
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    return path


def hdf5(path: Path, y: npt.NDArray[np.float64]) -> Path:
    h5py = pytest.importorskip("h5py")
    path = path.with_suffix(".h5")
    with h5py.File(path, "w") as file:
        file["y"], file["u"], file.attrs["fs"] = y, np.arange(float(N)), 100.0
    return path


FORMATS = {"npz": npz, "mat": mat, "mat4": mat4, "mat73": mat73, "hdf5": hdf5}


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("lying", [False, True])
def test_every_column_of_every_format(kind: str, lying: bool, tmp_path: Path) -> None:
    path = FORMATS[kind](tmp_path / "a", Y.T.copy() if lying else Y)
    for index in range(3):
        python = f"y[{index},:]" if lying else f"y[:, {index}]"
        matlab = f"y({index + 1},:)" if lying else f"y( : , {index + 1} )"
        record = read_record(path, {"a": python, "b": f"-{matlab}", "u": "u"})
        np.testing.assert_array_equal(record.signals["a"], Y[:, index])
        np.testing.assert_array_equal(record.signals["b"], -Y[:, index])
    source = open_source(path)
    first = ("y(1,:)" if lying else "y(:,1)") if "mat" in kind else ("y[0,:]" if lying else "y[:,0]")
    assert first in source.names and "y" not in source.names
    assert any("MATLAB counts" in text and "Python counts" in text for text in source.took)


@pytest.mark.parametrize(
    "place", ["y", "y[:,3]", "y(:,0)", "y(:,4)", "y[:]", "y[0,0]", "y[:,:]", "y[:,-1]", "y(1,:)"]
)
def test_a_column_that_is_not_there_is_explained(place: str, tmp_path: Path) -> None:
    with pytest.raises(DataError) as caught:
        read_record(mat(tmp_path / "a", Y), {"a": place})
    assert place in str(caught.value) and "y(:,1)" in str(caught.value)


@given(name=NAME, index=st.integers(0, 999_998), by_row=st.booleans())
def test_what_is_written_is_read(name: str, index: int, by_row: bool) -> None:
    column = MatrixColumn(name, index, by_row)
    assert column_of_text(column.written("python")) == column
    assert column_of_text(column.written("matlab")) == column


@given(st.text(max_size=40))
def test_no_text_breaks_it(text: str) -> None:
    column_of_text(text)


def test_times_may_stand_in_a_matrix(tmp_path: Path) -> None:
    log = np.column_stack((np.arange(N) / 200.0, Y))
    np.savez(tmp_path / "a.npz", log=log)
    record = read_record(tmp_path / "a.npz", {"q": "log[:,2]"}, time="log(:,1)")
    assert record.fs == pytest.approx(200.0)
    np.testing.assert_array_equal(record.signals["q"], Y[:, 1])


def test_pictures_and_blocks_are_left_out_and_named() -> None:
    side = MOST_SIDE + 1
    found, said = matrix_columns(
        {"map": (side, side), "block": (4, 5, 6), "y": (9, 2), "v": (9, 1)}, "python"
    )
    assert list(found) == ["y[:,0]", "y[:,1]"]
    assert "map (101 x 101), block (4 x 5 x 6)" in said[-1] or "block" in said[-1]


def test_an_array_with_the_name_of_a_column_comes_first(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{"y": Y, "y[:,0]": np.ones(N)}, fs=1.0)
    assert (read_record(tmp_path / "a.npz", {"q": "y[:,0]"}).signals["q"] == 1.0).all()
