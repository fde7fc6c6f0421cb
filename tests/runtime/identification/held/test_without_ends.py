from __future__ import annotations

from dataclasses import replace

import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.held import without_ends
from modelgen.runtime.identification.held.without_ends import default_without_ends
from modelgen.runtime.identification.methods import IV, Auto, Method
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import Task, prepared
from modelgen.runtime.records.record import Record
from tests.runtime.rigid_motion import RIGID, rigid_record


def with_brake() -> Record:
    """A brake slips within the first second: the force that it takes moves nothing."""
    record = rigid_record(noise=1e-7)
    (force,) = (one.key for one in RIGID.actuators)
    taken = record.signals[force].copy()
    taken[round(0.5 * record.fs) : round(record.fs)] += abs(taken).max()
    return record.edited({force: taken})


def run_with(
    task: Task, monkeypatch: pytest.MonkeyPatch, instead: Method, noise: bool, until: int, where: str = "K"
) -> Begun:
    """Run a default that refuses records of as many samples, and explains others to their noise or not."""

    def default(given: Task, method: Auto) -> Begun:
        if given.job.records[0].n >= until:
            raise IdentifiabilityError.at(where, f"{given.job.records[0].n} samples", "nothing")
        return replace(run_method(given, method.least_squares), task=replace(given, method=instead))

    monkeypatch.setattr(without_ends, "default_method", default)
    monkeypatch.setattr(without_ends, "exceeding", lambda _: not noise)
    return default_without_ends(task, Auto())


def test_ends_are_left_out_only_where_nothing_holds_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A brake that slips for 0.1 s of 4 had every parameter refused, all of which the rest tells."""
    record = with_brake()
    task = prepared(RIGID, record, Auto(), Filters(), CheckOptions())
    whole = run_with(task, monkeypatch, IV(), True, record.n + 1)
    assert whole.task.records[0].n == record.n
    assert not any("left out:" in note for note in whole.found.fit.notes)
    inner = run_with(task, monkeypatch, IV(), True, record.n)
    assert "first and the last 12.5 %" in inner.found.fit.notes[0]
    assert [one.n for one in inner.task.records] == [record.n - 2 * round(record.n / 8)]
    assert [one.name for one in inner.task.records] == [record.name]
    middle = record.part(round(record.n / 8), record.n - round(record.n / 8), record.name)
    assert (
        inner.task.job.records[0].signals[RIGID.sensors[0].key] == middle.signals[RIGID.sensors[0].key]
    ).all()


@pytest.mark.parametrize(
    ("instead", "noise", "middle_too", "where"),
    [
        (IV(), False, False, "K"),
        (IV(), True, True, "K"),
        (Auto().least_squares, True, False, "K"),
        (IV(), True, False, "rows"),
    ],
)
def test_what_does_not_hold_without_the_ends_is_refused_with_them(
    instead: Method, noise: bool, middle_too: bool, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The middle is taken where instruments explain it to its noise, and never where samples are too few."""
    record = with_brake()
    task = prepared(RIGID, record, Auto(), Filters(), CheckOptions())
    with pytest.raises(IdentifiabilityError, match=f"{record.n} samples"):
        run_with(task, monkeypatch, instead, noise, 1 if middle_too else record.n, where)


def test_ends_that_tell_what_the_rest_tells_are_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where noise hides a spring it does so without the ends as well, and to find that took two minutes."""
    task = prepared(RIGID, rigid_record(noise=1e-7), Auto(), Filters(), CheckOptions())
    tried = list[int]()

    def refuses(given: Task, method: Auto) -> Begun:
        tried.append(given.job.records[0].n)
        raise IdentifiabilityError.at("K", "is hidden by noise", "nothing")

    monkeypatch.setattr(without_ends, "default_method", refuses)
    with pytest.raises(IdentifiabilityError, match="hidden by noise"):
        default_without_ends(task, Auto())
    assert tried == [task.job.records[0].n]
