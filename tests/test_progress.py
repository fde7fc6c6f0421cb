"""Progress shows count, rate and time left on a terminal, and nothing elsewhere."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from modelgen.errors import Problem
from modelgen.output import explain
from modelgen.progress import counted


def test_a_terminal_sees_the_count() -> None:
    seen = io.StringIO()
    console = Console(file=seen, force_terminal=True, width=100)
    assert list(counted([1, 2, 3], "reading", console)) == [1, 2, 3]
    assert "reading" in seen.getvalue() and "3/3" in seen.getvalue()


def test_a_pipe_sees_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(counted([1, 2, 3], "reading")) == [1, 2, 3]
    assert capsys.readouterr() == ("", "")


def test_errors_are_one_line_in_a_pipe_and_two_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = Problem("run.csv", "is empty", "give samples")
    explain(problem)
    assert capsys.readouterr().err == "error: run.csv: is empty; give samples\n"
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    explain(problem)
    shown = re.sub("\x1b\\[[0-9;]*m", "", capsys.readouterr().err)
    assert [line.strip() for line in shown.splitlines()] == [
        "error: run.csv: is empty",
        "try: give samples",
    ]
