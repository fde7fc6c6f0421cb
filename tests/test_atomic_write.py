"""A file is there whole, or nothing has changed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from modelgen.atomic_write import write_whole
from modelgen.errors import ModelgenError


def test_a_file_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_whole(path, b"one", overwrite=False)
    assert path.read_bytes() == b"one"
    other = tmp_path / "b.csv"
    other.write_bytes(b"")
    assert path.stat().st_mode == other.stat().st_mode


def test_a_file_is_replaced_on_request_only(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"one")
    with pytest.raises(ModelgenError, match="exists already"):
        write_whole(path, b"two", overwrite=False)
    assert path.read_bytes() == b"one"
    write_whole(path, b"two", overwrite=True)
    assert path.read_bytes() == b"two"


def test_the_folder_must_exist(tmp_path: Path) -> None:
    with pytest.raises(ModelgenError, match="create the folder first"):
        write_whole(tmp_path / "absent" / "a.csv", b"", overwrite=True)


def test_nothing_is_left_of_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"one")

    def full(source: object, target: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ModelgenError, match="No space left on device"):
        write_whole(path, b"two", overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.csv"]
    assert path.read_bytes() == b"one"


def test_an_interruption_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(handle: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a.csv", b"two", overwrite=True)
    assert list(tmp_path.iterdir()) == []
