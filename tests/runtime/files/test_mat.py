"""MATLAB files of level 4 and 5: every variable as SciPy reads it, whatever its type, shape and storage."""

from __future__ import annotations

import io
import struct
import tempfile
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat, savemat, whosmat

from generated import emps300_qm_qc
from modelgen.cli.import_file import describe_file
from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.mat import open_variables
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.read_record import read_record

KINDS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "c16", "c8", "?")
LEVEL4 = ("f8", "f4", "i4", "i2", "u2", "u1", "c16")
TEXT = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FF), max_size=12)
NAMES = st.from_regex("[a-zA-Z][a-zA-Z0-9_]{0,30}", fullmatch=True)


def numbers(kinds: tuple[str, ...], least: int, most: int) -> st.SearchStrategy[Any]:
    shapes = hnp.array_shapes(min_dims=least, max_dims=most, min_side=0, max_side=5)
    return st.sampled_from(kinds).flatmap(lambda kind: hnp.arrays(kind, shapes, elements=single(kind)))


def single(kind: str) -> st.SearchStrategy[Any]:
    # SciPy multiplies imaginary parts by 1j, which makes NaN of what is infinite
    real = kind[0] != "c"
    return hnp.from_dtype(np.dtype(kind), allow_infinity=real, allow_nan=real)


def cell_of(values: list[Any]) -> Any:
    cell = np.empty(len(values), dtype=object)
    cell[:] = values
    return cell


LEAVES = numbers(KINDS, 0, 3) | TEXT
NESTED = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3).map(cell_of) | st.dictionaries(NAMES, inner, min_size=1),
    max_leaves=5,
)


def same(mine: Any, theirs: Any) -> bool:
    """Compare a value with what SciPy reads (struct_as_record, squeeze_me off)."""
    if isinstance(mine, dict):
        entries = theirs.ravel(order="F")
        return set(mine) == set(theirs.dtype.names or ()) and all(
            len(values) == entries.size
            and all(same(value, entry[key]) for value, entry in zip(values, entries, strict=True))
            for key, values in mine.items()
        )
    if isinstance(mine, list):
        return len(mine) == theirs.size and all(map(same, mine, theirs.ravel(order="F")))
    if isinstance(mine, str):
        return mine == "".join(theirs.ravel())
    if mine.size == 0 or theirs.size == 0:
        return mine.size == theirs.size
    return mine.shape == theirs.shape and np.array_equal(mine, theirs, equal_nan=True)


def check(content: bytes) -> None:
    theirs = {k: v for k, v in loadmat(io.BytesIO(content)).items() if k[:2] != "__"}
    classes = {name: class_ for name, _, class_ in whosmat(io.BytesIO(content))}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mat"
        path.write_bytes(content)
        found = open_variables(path)
        assert list(found.variables) == list(theirs)
        for name, value in theirs.items():
            variable = found.variables[name]
            mine = found.value(name) if variable.what != "sparse" else None
            if mine is None or (found.level == 4 and variable.what == "other"):
                continue
            assert same(mine, value), (name, mine, value)
            if variable.is_numeric:
                assert variable.shape == value.shape
                kind = {"double": "float64", "single": "float32", "logical": "uint8"}.get(
                    classes[name], classes[name]
                )
                assert found.level == 4 or mine.real.dtype == kind


@pytest.mark.slow
@settings(max_examples=100)
@given(st.dictionaries(NAMES, NESTED, max_size=4), st.booleans())
def test_level_5_as_scipy_reads_it(values: dict[str, Any], packed: bool) -> None:
    content = io.BytesIO()
    savemat(content, values, do_compression=packed)
    check(content.getvalue())


@pytest.mark.slow
@settings(max_examples=100)
@given(st.dictionaries(NAMES, numbers(LEVEL4, 0, 2), min_size=1, max_size=4))
def test_level_4_as_scipy_reads_it(values: dict[str, Any]) -> None:
    content = io.BytesIO()
    savemat(content, values, format="4")
    check(content.getvalue())


def element(order: str, kind: int, data: bytes, small: bool = False) -> bytes:
    """Return an element of level 5, packed into its tag where that is asked for and possible."""
    if small and len(data) <= 4:
        return struct.pack(f"{order}I", len(data) << 16 | kind) + data.ljust(4, b"\0")
    return struct.pack(f"{order}2I", kind, len(data)) + data + bytes(-len(data) % 8)


def array(order: str, name: str, values: Any, class_: int, stored: tuple[int, str], small: bool) -> bytes:
    kind, dtype = stored
    parts = [np.real(values), np.imag(values)] if np.iscomplexobj(values) else [values]
    flags = class_ | (0x800 if len(parts) == 2 else 0)
    content = element(order, 6, struct.pack(f"{order}2I", flags, 0))
    content += element(order, 5, struct.pack(f"{order}{values.ndim}i", *values.shape))
    content += element(order, 1, name.encode(), small)
    for part in parts:
        content += element(order, kind, part.astype(order + dtype).tobytes(order="F"), small)
    return element(order, 14, content)


STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


@pytest.mark.slow
@settings(max_examples=200)
@given(
    st.sampled_from("<>"),
    st.sampled_from(sorted(STORED.items())),
    st.sampled_from([6, 7]),
    st.booleans(),
    st.booleans(),
    st.data(),
)
def test_every_storage_of_doubles_and_singles_in_both_byte_orders(
    order: str, stored: tuple[int, str], class_: int, small: bool, is_complex: bool, data: st.DataObject
) -> None:
    shape = hnp.array_shapes(min_dims=2, max_dims=3, min_side=1, max_side=4)
    values = data.draw(hnp.arrays("i1" if stored[1][0] != "u" else "u1", shape)).astype("f8")
    values = values + 1j * values[::-1] if is_complex else values
    mark = b"\x00\x01IM" if order == "<" else b"\x01\x00MI"
    check(b"MATLAB 5.0 MAT-file".ljust(124) + mark + array(order, "v", values, class_, stored, small))


def test_level_4_in_big_endian(tmp_path: Path) -> None:
    values = np.arange(6.0).reshape(2, 3)
    content = struct.pack(">5i", 1000, 2, 3, 1, 2) + b"v\0"
    content += values.astype(">f8").tobytes("F") + (-values).astype(">f8").tobytes("F")
    check(content)


def test_measured_records_as_scipy_reads_them() -> None:
    folder = Path(__file__).parents[2].parent / "shared" / "data"
    paths = sorted(folder.glob("*/*.mat"))
    if not paths:
        pytest.skip("no measured records")
    for path in paths:
        theirs, found = loadmat(path, mat_dtype=True), open_variables(path)
        for name, variable in found.variables.items():
            if variable.is_numeric:
                np.testing.assert_array_equal(found.value(name), theirs[name])


def test_what_is_neither_numbers_nor_text_is_named(tmp_path: Path) -> None:
    from scipy.sparse import eye

    savemat(tmp_path / "a.mat", {"S": eye(3, format="csc"), "q": np.arange(3.0), "s": {"a": 1}, "text": "x"})
    source = open_source(tmp_path / "a.mat")
    assert source.names == ("q",)
    assert source.took == ("left out: S (sparse)",)


def test_a_variable_that_stands_there_twice(tmp_path: Path) -> None:
    contents = []
    for factor in (1.0, 2.0):
        savemat(tmp_path / "a.mat", {"q": factor * np.arange(3.0)})
        contents.append((tmp_path / "a.mat").read_bytes())
    (tmp_path / "a.mat").write_bytes(contents[0] + contents[1][128:])
    source = open_source(tmp_path / "a.mat")
    np.testing.assert_array_equal(source.load(("q",))["q"], [0.0, 2.0, 4.0])
    assert source.took == ("stored more than once, the last one counts: q",)


@pytest.mark.parametrize("packed", [False, True])
def test_only_what_is_asked_for_is_read(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"q": np.arange(5000.0), "F": np.arange(5000.0)}, do_compression=packed)
    content = bytearray(path.read_bytes())
    content[-3000:-2900] = bytes(100)
    path.write_bytes(content)
    np.testing.assert_array_equal(open_source(path).load(("q",))["q"], np.arange(5000.0))
    if packed:
        with pytest.raises(DataError, match=r"a\.mat: is no readable MATLAB file"):
            open_source(path).load(("F",))


def test_a_member_of_an_archive_that_stands_there_twice(tmp_path: Path) -> None:
    path, member = tmp_path / "a.npz", io.BytesIO()
    np.save(member, np.arange(3.0))
    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(2):
            archive.writestr("q.npy", member.getvalue())
    assert open_source(path).took == ("stored more than once, the last one counts: q",)


@pytest.mark.parametrize("packed", [False, True])
def test_structures_are_read_by_the_places_of_their_arrays(tmp_path: Path, packed: bool) -> None:
    q, F = np.arange(5.0), np.arange(5.0) ** 2
    scope = np.zeros((1, 2), dtype=[("values", object), ("label", object)])
    for place, (label, values) in enumerate((("q_m", q), ("torque", F))):
        scope[0, place] = (values[:, None], label)
    plain = scope.copy()
    plain[0, 1]["label"] = "q_m"  # which no longer tells them apart
    log = {"time": q / 100.0, "signals": {"q_m": q, "torque": F, "text": "none"}, "gain": 2.0}
    contents = {"log": log, "Scope": {"signals": scope}, "Plain": {"signals": plain}, "q": q}
    savemat(tmp_path / "a.mat", contents, do_compression=packed)
    source = open_source(tmp_path / "a.mat")
    wanted = {
        **{"q": q, "log.time": q / 100.0, "log.signals.q_m": q, "log.signals.torque": F},
        **{"Scope.signals.q_m": q, "Scope.signals.torque": F},
        **{"Plain.signals(1).values": q, "Plain.signals(2).values": F},
    }
    assert set(source.names) == set(wanted)
    for name, values in source.load(source.names).items():
        np.testing.assert_array_equal(values, wanted[name])
    assert dict(source.scalars) == {"log.gain": 2.0}


def test_a_structure_that_is_too_deep_costs_itself_alone(tmp_path: Path) -> None:
    deep: dict[str, object] = {"x": np.arange(3.0)}
    for _ in range(20):
        deep = {"a": deep}
    savemat(tmp_path / "a.mat", {"deep": deep, "q": np.arange(3.0)})
    source = open_source(tmp_path / "a.mat")
    assert source.names == ("q",)
    assert source.took[0].startswith("left out: deep (a structure: it holds structures too deep")


@pytest.mark.parametrize("packed", [False, True])
def test_cells_are_read_by_the_places_of_their_arrays(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"c": cell_of([np.arange(5.0), "q_m", 2.0 * np.arange(5.0)])}, do_compression=packed)
    source = open_source(path)
    assert source.names == ("c{1}", "c{3}")
    np.testing.assert_array_equal(source.load(["c{3}"])["c{3}"], 2.0 * np.arange(5.0))


def test_of_several_runs_in_a_file_the_times_are_those_of_the_channels(tmp_path: Path) -> None:
    model = model_from_module(emps300_qm_qc)
    samples = {key: np.sin(np.arange(50.0) + k) for k, key in enumerate(model.channels)}
    runs = {f"run{k}": {"t": np.arange(50.0) / 1000.0 + k, **samples} for k in (1, 2)}
    savemat(tmp_path / "a.mat", runs)
    described = describe_file(tmp_path / "a.mat", model)
    assert (described["time"], described["problems"]) == ("run1.t", [])
    assert {entry["column"] for entry in described["channels"]} == {f"run1.{key}" for key in samples}


def test_times_in_structures_are_those_of_their_structure(tmp_path: Path) -> None:
    """A timeseries that was saved as structure: its times are no position, and of no other one."""
    path, t = tmp_path / "run.mat", np.arange(200) * 1e-3
    pairs = {"q": (t, np.sin(20.0 * t)), "F": (t + 0.004, np.cos(20.0 * t))}
    savemat(path, {key: {"Time": times, "Data": values} for key, (times, values) in pairs.items()})
    source = open_source(path)
    assert dict(source.clocks) == {"q.Data": "q.Time", "F.Data": "F.Time"}
    assert read_record(path, {"q": "q.Data"}).fs == pytest.approx(1000.0)
    with pytest.raises(DataError, match=r"F starts 0\.004 s after q"):
        read_record(path, {"q": "q.Data", "F": "F.Data"})
