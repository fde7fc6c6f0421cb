"""A trap around every test of this folder: no input may run a program, load a pickle or execute code."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from modelgen.runtime.files.child_process.reader_process import START

FORBIDDEN = (
    "os.system",
    "os.exec",
    "os.spawn",
    "os.posix_spawn",
    "subprocess.Popen",
    "pickle.find_class",
    "socket.",
)
_caught: list[str] = []
_armed: list[bool] = []


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if not _armed or not event.startswith(FORBIDDEN):
        return
    uname = (
        event == "subprocess.Popen" and arguments[0] == "uname"
    )  # the platform module asks what this machine is
    # nor does it matter where a file is read
    reader = event == "subprocess.Popen" and list(arguments[1][:4]) == [sys.executable, "-I", "-c", START]
    if not uname and not reader:
        _caught.append(f"{event} {arguments!r}")


sys.addaudithook(_watch)  # cannot be taken away again: it listens while a test of this folder runs only


@pytest.fixture(autouse=True)
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Run in an empty folder; fail when a payload has run: they write "pwned" there, or set PWNED."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PWNED", raising=False)
    _caught.clear()
    _armed.append(True)
    try:
        yield tmp_path
    finally:
        _armed.clear()
    assert not list(tmp_path.rglob("pwned*"))
    assert "PWNED" not in os.environ
    assert _caught == []


@pytest.fixture
def processes(trap: Path) -> Path:
    """The empty folder, for a test that starts processes of its own."""
    _armed.clear()
    return trap
