"""Inputs are opened in one place: whoever opens a file elsewhere is found by the source itself."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import modelgen
from modelgen.read_file import check_file

PACKAGE = Path(modelgen.__file__).parent
METHODS = {
    "open",
    "fdopen",
    "read_text",
    "read_bytes",
    "loadtxt",
    "genfromtxt",
    "loadmat",
    "whosmat",
    "memmap",
}
METHODS |= {"fromfile", "ZipFile", "is_zipfile", "File", "MDF", "ParquetFile", "read_table", "read_schema"}
METHODS |= {"read_metadata", "FileSystemLoader"}
LOADERS = {f"{library}.{name}" for library in ("np", "json", "tomllib") for name in ("load", "loads")}
LOADERS |= {"nptdms.TdmsFile.read"}
BUILT_IN = {"open", "mmap"}
GATED = "opens by name what file_formats or open_channels has checked"
ALLOWED = {
    "read_file.py": "the one place",
    "documents.py": "parses texts",
    "atomic_write.py": "writes",
    "template_folder.py": "the program's own templates",
    "cli/standard_streams.py": "the null device, in place of a closed stream",
    "render/environment.py": "the program's own templates",
    "render/user_templates.py": "the pipe of its child, and what the system says of its memory",
    "runtime/exports/fmu.py": "the program's own C source, and what the compiler made of it",
    "runtime/files/child_process/reader_process.py": "what its own child answers",
    "runtime/files/npz_and_mat.py": GATED,
    "runtime/files/child_process/hdf5_calls.py": GATED,
    "runtime/files/child_process/mdf_calls.py": GATED,
    "runtime/files/child_process/reader_child.py": "the child's own streams, and the null device",
    "runtime/files/parquet.py": GATED,
    "runtime/files/tdms.py": GATED,
    "runtime/files/text.py": "numbers of a handle that open_file gave",
    "runtime/files/open_channels.py": GATED,
    "runtime/files/npy_channels.py": "maps a handle that open_file gave; check_file has seen the header",
    "runtime/records/write_record.py": "writes an archive into memory",
}


def reading_calls(path: Path) -> list[str]:
    """Return the calls of a file that go by the name of a reader; those of read_file are functions."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            name = ast.unparse(node.func)
            method = isinstance(node.func, ast.Attribute) and node.func.attr in METHODS
            found += [name] if method or name in LOADERS | BUILT_IN else []
    return found


def test_files_are_opened_in_no_other_place_and_what_is_allowed_is_needed() -> None:
    files = sorted(str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py"))
    opens = {file: calls for file in files if (calls := reading_calls(PACKAGE / file))}
    assert {file: calls for file, calls in opens.items() if file not in ALLOWED} == {}
    assert [file for file in ALLOWED if file not in opens] == []


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("open(a)", "open"),
        ("path().read_text()", "path().read_text"),
        ("np.load(a)", "np.load"),
        ("b(json.loads(a))", "json.loads"),
        ("nptdms.TdmsFile.read(a)", "nptdms.TdmsFile.read"),
    ],
)
def test_a_call_that_reads_is_seen(tmp_path: Path, line: str, name: str) -> None:
    (tmp_path / "a.py").write_text(f"def f():\n    return {line}\n")
    assert reading_calls(tmp_path / "a.py") == [name]


def test_the_gate_is_what_the_formats_pass() -> None:
    names = ("formats.py", "open_channels.py", "npy_channels.py")
    gates = [PACKAGE / "runtime" / "files" / name for name in names]
    assert all(f"{check_file.__name__}(" in gate.read_text() for gate in gates)
