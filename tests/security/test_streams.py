"""Standard input, output and error closed, full or in an odd encoding: a message or silence, no traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(ROOT),
    "PYTHON": sys.executable,
    "PYTHONDONTWRITEBYTECODE": "1",
}
REDIRECTIONS = {
    "stdout closed": (">&-", (0, 2)),
    "stderr closed": ("2>&-", (0, 2)),
    "both closed": (">&- 2>&-", (0, 2)),
    "all closed": ("<&- >&- 2>&-", (0, 2)),
    "stdout full": (">/dev/full", (2, 2)),
    "stderr full": ("2>/dev/full", (0, 2)),
    "both full": (">/dev/full 2>/dev/full", (2, 2)),
    "nobody reads": ("| true", (0, 0)),
}
COMMANDS = {"good": ("show emps_rigid", 0), "wrong": ("show nonesuch", 1)}


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", command],
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        text=True,
        encoding="latin-1",
        timeout=60,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("kind", REDIRECTIONS)
def test_a_stream_that_takes_nothing(processes: Path, kind: str, command: str) -> None:
    redirection, codes = REDIRECTIONS[kind]
    words, wrong = COMMANDS[command]
    done = shell(f'"$PYTHON" -m modelgen {words} {redirection}')
    assert done.returncode == codes[wrong]
    assert all(line.startswith("error: ") for line in done.stderr.splitlines())
    if kind == "stdout full" and not wrong:
        assert done.stderr.startswith("error: standard output: No space left on device; check where")


def test_help_on_a_full_disk(processes: Path) -> None:
    done = shell('"$PYTHON" -m modelgen --help > /dev/full')
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("error: standard output: No space left on device")


@pytest.mark.slow
def test_what_is_written_does_not_take_the_place_of_a_closed_stream(processes: Path) -> None:
    words = "generate emps_rigid --sensors qm -o out"
    assert shell(f'"$PYTHON" -m modelgen {words} <&- >&- 2>&-').returncode == 0
    (written,) = (processes / "out").iterdir()
    assert written.read_bytes() == (ROOT / "generated" / "emps_rigid_qm.py").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "cp500", "utf-32", "latin-1"])
def test_an_encoding_without_greek_letters(processes: Path, encoding: str) -> None:
    done = shell('"$PYTHON" -m modelgen show emps300', PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
