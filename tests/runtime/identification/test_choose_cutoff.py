"""Cut-offs for instruments of arms: turns of joints are left out, and enough of every row remains."""

from __future__ import annotations

from functools import cache

import pytest

from modelgen.runtime.identification import choose_cutoff
from modelgen.runtime.identification.choose_cutoff import with_calm_turns
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import Task, prepared
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of


@cache
def task(**filters: float) -> Task:
    model = model_of(catalogued("two_link"))
    record = record_of(model, values_of(model), 10.0, noise=(2e-5, 0.1))
    return prepared(model, record, IV(), Filters(**filters), CheckOptions())


def least_kept(found: Task) -> float:
    """Share of the record that the row that keeps least keeps; 0 where one does not leave turns out."""
    every = found.records[0].n / found.choice.decimation[0]
    blocks = found.job.calm(found.records).blocks
    return min(0.0 if block.turning else block.count / every for block in blocks)


def test_turns_are_left_out_and_most_of_every_row_stays() -> None:
    assert least_kept(task()) < choose_cutoff.CALM_SHARE <= least_kept(with_calm_turns(task()))


def test_where_no_cut_off_keeps_enough_the_one_that_keeps_most_is_better_than_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(choose_cutoff, "CALM_SHARE", 0.5)
    enough = with_calm_turns(task())
    monkeypatch.setattr(choose_cutoff, "CALM_SHARE", 1.0)
    most = with_calm_turns(task())
    assert most.choice.cutoff_hz > enough.choice.cutoff_hz
    assert choose_cutoff.LEAST_CALM <= least_kept(enough) < least_kept(most) < 1.0
    monkeypatch.setattr(choose_cutoff, "LEAST_CALM", 1.0)
    assert with_calm_turns(task()) is task()


def test_a_cut_off_that_was_given_stays() -> None:
    given = task(cutoff_hz=5.0)
    assert with_calm_turns(given) is given
