from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.project.history import HistoryEntry, append
from tests.runtime.made_estimates import estimate_of

PROJECT = 'spec = "emps300"\nsensors = "qm_ac"\n[[records]]\nfiles = ["gone.csv"]\n'


def entry(month: int, value: float, project: str = "axis", name: str | None = None) -> HistoryEntry:
    records = {f"{month}.csv": f"{project}{month}"}
    label = date(2026, month, 1) if name is None else None
    return HistoryEntry(project, label, records, "x", estimate_of({"K": value, "J": 2.0}, name=name or "r"))


@pytest.fixture
def history(tmp_path: Path) -> Path:
    path = tmp_path / "axis.history.jsonl"
    for month in (1, 2, 3, 6, 5, 4):  # out of order
        append(path, entry(month, 100.0 + (9.0 if month >= 4 else 0.0)))
    return path


def run(*arguments: object, code: int = 0) -> Any:
    done = CliRunner().invoke(app, ["trend", *map(str, arguments)])
    assert done.exit_code == code, done.output
    return done


def test_a_change_with_its_entry_and_interval(history: Path) -> None:
    (machine,) = json.loads(run(history, "--json").stdout)["machines"]
    assert machine["entries"] == [f"2026-0{month}-01" for month in range(1, 7)]
    assert machine["changed"] == ["K"]
    (change,) = next(one for one in machine["quantities"] if one["name"] == "K")["changes"]
    assert (change["since"], change["until"]) == ("2026-04-01", None)
    assert change["difference"] == pytest.approx(9.0)
    assert change["difference_percent"] == pytest.approx(9.0)
    assert change["interval_95"][0] < 9.0 < change["interval_95"][1]
    printed = run(history).stdout
    assert "K [N]" in printed and "since 2026-04-01: 9.0 +- 1.6 (+9 %)" in printed
    assert "axis: changed: K" in printed


def test_check_ends_with_one_where_something_has_changed(history: Path, tmp_path: Path) -> None:
    run(history, "--check", code=1)
    calm = tmp_path / "calm.jsonl"
    for month in (1, 2):
        append(calm, entry(month, 100.0))
    assert "nothing has changed" in run(calm, "--check").stdout


def test_the_last_estimate_of_the_same_records_counts(history: Path) -> None:
    for month in (4, 5, 6):
        append(history, entry(month, 100.0))
    found = run(history).stdout
    assert "nothing has changed" in found
    assert "3 earlier estimates of the same records are left out" in found


def test_machines_of_one_history_are_apart(history: Path) -> None:
    for month in (1, 2, 3):
        append(history, entry(month, 100.0, "press"))
    described = json.loads(run(history, "--json").stdout)["machines"]
    assert [(one["machine"], one["changed"]) for one in described] == [("axis", ["K"]), ("press", [])]


def test_saved_estimates_in_their_order(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.json" for name in ("before", "after")]
    for path, value in zip(paths, (100.0, 120.0), strict=True):
        estimate_of({"K": value}).save(path)
    (machine,) = json.loads(run(*paths, "--json").stdout)["machines"]
    assert machine["entries"] == ["before", "after"]
    assert machine["changed"] == ["K"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_picture_is_the_same_bytes(history: Path, tmp_path: Path, suffix: str) -> None:
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        run(history, "--plot", path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert "exists already" in run(history, "--plot", paths[0], code=2).stderr


def test_what_is_no_history_is_explained(history: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone.jsonl"
    append(alone, entry(1, 1.0))
    (tmp_path / "axis.toml").write_text(
        'spec = "emps300"\nsensors = "qm_ac"\n[[records]]\nfiles = ["a.csv"]\n'
    )
    (tmp_path / "new.toml").write_text(
        'spec = "emps300"\nsensors = "qm_ac"\n[[records]]\nfiles = ["a.csv"]\n'
    )
    assert "axis: changed: K" in run(tmp_path / "axis.toml").stdout  # its records need not be there
    for given, words in (
        ([tmp_path / "none.jsonl"], "cannot be read"),
        ([tmp_path / "a.csv"], "is no history"),
        ([alone], "has 1 estimate"),
        ([history, history], "is given twice"),
        ([tmp_path / "new.toml"], "is not there yet"),
        ([history, "--plot", tmp_path / "a.gif"], "has the suffix"),
    ):
        done = run(*given, code=2)
        assert words in done.stderr
        assert all(line.startswith("error: ") for line in done.stderr.splitlines())
