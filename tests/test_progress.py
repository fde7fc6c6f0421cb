"""Progress shows count, rate and time left on a terminal, and nothing elsewhere."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from modelgen.cli.output import explain
from modelgen.errors import Problem
from modelgen.progress import counted, heard, shown, step


def test_a_terminal_sees_the_count_and_the_rate() -> None:
    seen = io.StringIO()
    with shown(Console(file=seen, force_terminal=True, width=100)):
        assert list(counted([1, 2, 3], "reading")) == [1, 2, 3]
    assert "reading" in seen.getvalue() and "3/3" in seen.getvalue()
    assert re.search(r"[\d.e+]+/s", seen.getvalue())


def test_a_list_within_a_list_has_a_line_of_its_own() -> None:
    seen = io.StringIO()
    with shown(Console(file=seen, force_terminal=True, width=100)):
        for _ in counted([1, 2], "records"):
            assert list(counted(range(4), "rows")) == [0, 1, 2, 3]
    assert re.search(r"records.*1/2.*rows.*4/4", seen.getvalue(), re.DOTALL)


def test_steps_are_shown_but_not_those_of_every_item() -> None:
    seen = io.StringIO()
    with shown(Console(file=seen, force_terminal=True, width=100)):
        step("reading")
        for _ in counted([1, 2], "records"):
            step("within")
        step("judging")
    assert "reading ...\n" in seen.getvalue() and seen.getvalue().endswith("judging ...\n")
    assert "within" not in seen.getvalue()


def test_whoever_listens_hears_steps_as_long_as_he_listens() -> None:
    outer: list[str] = []
    inner: list[str] = []
    step("before")
    with heard(outer.append):
        step("one")
        with pytest.raises(ValueError, match="stop"), heard(inner.append):
            step("two")
            raise ValueError("stop")
        step("three")
    step("after")
    assert (outer, inner) == (["one", "two", "three"], ["two"])


def test_a_mistake_within_ends_the_display() -> None:
    seen = io.StringIO()
    with shown(Console(file=seen, force_terminal=True, width=100)):
        with pytest.raises(ValueError, match="stop"):
            for _ in counted([1, 2], "records"):
                raise ValueError("stop")
        assert list(counted([1, 2], "afterwards")) == [1, 2]
    assert "afterwards" in seen.getvalue()


def test_a_library_is_silent(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert list(counted([1, 2, 3], "reading")) == [1, 2, 3]
    assert capsys.readouterr() == ("", "")


def test_a_pipe_sees_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with shown():
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
