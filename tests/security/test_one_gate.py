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
    calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    methods = [
        ast.unparse(call) for call in calls if isinstance(call, ast.Attribute) and call.attr in METHODS
    ]
    named = [ast.unparse(call) for call in calls]
    return methods + [name for name in named if name in LOADERS | BUILT_IN]


FILES = sorted(str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("file", [file for file in FILES if file not in ALLOWED])
def test_no_other_place_opens_files(file: str) -> None:
    assert reading_calls(PACKAGE / file) == []


@pytest.mark.parametrize("file", ALLOWED)
def test_what_is_allowed_is_needed(file: str) -> None:
    assert reading_calls(PACKAGE / file)


def test_the_gate_is_what_the_formats_pass() -> None:
    names = ("formats.py", "open_channels.py", "npy_channels.py")
    gates = [PACKAGE / "runtime" / "files" / name for name in names]
    assert all(f"{check_file.__name__}(" in gate.read_text() for gate in gates)
