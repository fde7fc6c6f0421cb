"""Every notebook of the documentation runs from top to bottom; the site shows how it ran when built."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted(
    path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs/notebooks").glob("*.py")
)


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS)
def test_notebook_runs_and_its_assertions_hold(
    notebook: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    runpy.run_path(str(ROOT / "docs" / notebook))


@pytest.mark.parametrize("notebook", NOTEBOOKS)
def test_notebook_is_text_that_jupytext_reads(notebook: str) -> None:
    """It starts with its title, and every mark of a cell is one of the two that are known."""
    lines = (ROOT / "docs" / notebook).read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# %% [markdown]" and lines[1].startswith("# # ")
    marks = [line for line in lines if re.match(r"#\s*%%", line)]
    assert set(marks) == {"# %%", "# %% [markdown]"}
    assert any(line.startswith(("    assert ", "assert ")) for line in lines)


def test_every_notebook_is_in_the_navigation() -> None:
    listed = re.findall(r": (notebooks/[\w/-]+\.py)", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(listed) == NOTEBOOKS
