from __future__ import annotations

import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from modelgen.errors import DataError
from modelgen.project.history import HistoryEntry, append, load_history
from tests.runtime.made_estimates import estimate_of


@pytest.fixture
def entry() -> HistoryEntry:
    estimate = estimate_of({"K": 100.0, "J": 2.0})
    return HistoryEntry("axis", date(2026, 1, 31), {"run.csv": "ab"}, "cd", estimate)


def test_entries_come_back_in_their_order(tmp_path: Path, entry: HistoryEntry) -> None:
    path = tmp_path / "a.history.jsonl"
    others = [replace(entry, date=date(2026, month, 1)) for month in (3, 2)]
    for one in (entry, *others):
        assert append(path, one)
    back = load_history(path)
    assert [one.line() for one in back] == [one.line() for one in (entry, *others)]
    assert [one.label for one in back] == ["2026-01-31", "2026-03-01", "2026-02-01"]


def test_the_same_entry_is_there_once(tmp_path: Path, entry: HistoryEntry) -> None:
    path = tmp_path / "a.history.jsonl"
    assert append(path, entry)
    before = path.read_bytes()
    assert not append(path, entry)
    assert path.read_bytes() == before
    assert append(path, replace(entry, records={"run.csv": "ac"}))
    assert path.read_bytes().startswith(before)


def test_a_line_without_its_end_stays_a_line(tmp_path: Path, entry: HistoryEntry) -> None:
    path = tmp_path / "a.history.jsonl"
    path.write_text(entry.line().rstrip("\n"))
    assert append(path, replace(entry, inputs="other"))
    assert len(load_history(path)) == 2


def test_every_line_that_is_none_is_named(tmp_path: Path, entry: HistoryEntry) -> None:
    path = tmp_path / "a.history.jsonl"
    good = json.loads(entry.line())
    lines = [
        entry.line().strip(),
        "{",
        "[]",
        json.dumps({**good, "date": "yesterday"}),
        json.dumps({**good, "odd": 1}),
        json.dumps({**good, "version": 2}),
        json.dumps({**good, "estimate": {**good["estimate"], "nobs": 7}}),
        json.dumps({key: value for key, value in good.items() if key != "records"}),
    ]
    path.write_text("\n".join(lines))
    with pytest.raises(DataError) as caught:
        load_history(path)
    named = {
        problem.where.partition(".jsonl: ")[2].partition(":")[0].split(" column")[0]
        for problem in caught.value.problems
    }
    assert {f"line {number}" for number in range(2, 9)} == named


def test_a_history_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.jsonl"):
        load_history(tmp_path / "none.jsonl")
