"""Several processes that write one file: one of them does, whole, and nobody's draft is touched."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from modelgen.atomic_write import write_whole
from modelgen.errors import ModelgenError

ROOT = Path(__file__).resolve().parents[2]
RACE = (
    "import os, sys; from modelgen.atomic_write import write_whole\n"
    "from modelgen.errors import ModelgenError\n"
    "if sys.argv[3] == 'without links': del os.link\n"
    "print('ready', flush=True); sys.stdin.readline()\n"
    "try: write_whole(sys.argv[1], sys.argv[2].encode() * 1_000_000, overwrite=False)\n"
    "except ModelgenError as error: sys.exit(str(error))\n"
)


@pytest.mark.parametrize("links", ["with links", "without links"])
def test_of_four_processes_one_wins(processes: Path, links: str) -> None:
    path = processes / "a.csv"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipe = subprocess.PIPE
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", RACE, str(path), letter, links],
            env=environment, stdin=pipe, stdout=pipe, stderr=pipe, text=True,
        )
        for letter in "abcd"
    ]  # fmt: skip
    for racer in racers:
        assert racer.stdout is not None
        assert racer.stdout.readline() == "ready\n"
    said = []
    for racer in racers:
        assert racer.stdin is not None
        racer.stdin.write("\n")
        racer.stdin.flush()
    for racer in racers:
        said.append(racer.communicate(timeout=60)[1])
    winners = [letter for letter, words in zip("abcd", said, strict=True) if not words]
    assert len(winners) == 1
    assert (
        sorted(filter(None, said))
        == [f"{path}: exists already; choose another name, or replace it (--overwrite; overwrite=True)\n"] * 3
    )
    assert path.read_bytes() == winners[0].encode() * 1_000_000
    assert [entry.name for entry in processes.iterdir()] == ["a.csv"]


def test_drafts_of_others_stay(trap: Path) -> None:
    names = [f".modelgen-{os.getpid()}-{threading.get_ident()}-{number}.tmp" for number in range(3)]
    for name in names:
        (trap / name).write_text("mine")
    for overwrite in (False, True):
        write_whole(trap / "a.csv", b"new", overwrite=overwrite)
        assert sorted(entry.name for entry in trap.iterdir()) == sorted([*names, "a.csv"])
    assert all((trap / name).read_text() == "mine" for name in names)


def test_a_name_as_long_as_names_may_be(trap: Path) -> None:
    write_whole(trap / ("a" * 255), b"new", overwrite=False)
    assert (trap / ("a" * 255)).read_bytes() == b"new"


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_failure_leaves_what_was_there(
    trap: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "link", refuse)
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(ModelgenError, match="No space left on device"):
        write_whole(trap / "a.csv", b"new", overwrite=overwrite)
    assert list(trap.iterdir()) == []
