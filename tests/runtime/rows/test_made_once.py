"""What filters make of a channel is made once for all records that hold the same samples of it."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.time_shifts import CLOCK_POINTS, interpolation_weights
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import made_once
from modelgen.runtime.rows.filter_sections import matched_filtering
from modelgen.runtime.rows.record_rows import unmasked_rows

RECORD = Record({"q": np.arange(50.0), "f": np.ones(50)}, 100.0)


def test_an_edited_record_shares_what_was_made_of_the_channels_that_are_the_same() -> None:
    record = Record(RECORD.signals, RECORD.fs)
    of_q, of_f = (made_once(record, key, "how", lambda: np.zeros(3)) for key in ("q", "f"))
    edited = record.edited({"f": Edit("f", lambda samples, _: 2.0 * samples), "g": np.ones(50)})
    assert made_once(edited, "q", "how", lambda: np.ones(3)) is of_q
    assert made_once(edited, "q", "otherwise", lambda: np.ones(3))[0] == 1.0
    for key in ("f", "g"):
        found = made_once(edited, key, "how", lambda: np.ones(3))
        assert found is not of_f
        assert found[0] == 1.0
    # what is made later of the same samples is shared as well
    later = made_once(edited, "q", "later", lambda: np.ones(3))
    assert made_once(record, "q", "later", lambda: np.zeros(3)) is later
    # so is what is known of the samples
    assert edited.facts.spectrum("q") is record.facts.spectrum("q")
    assert edited.facts.extent("f").peak == 2.0 * record.facts.extent("f").peak
    record.facts.forget_filtered()
    assert made_once(edited, "q", "how", lambda: np.ones(3)) is not of_q


def test_records_that_are_read_in_stretches_or_are_long_keep_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stretched = Record.over(RECORD)
    first = made_once(stretched, "q", "how", lambda: np.zeros(3))
    assert made_once(stretched, "q", "how", lambda: np.zeros(3)) is not first
    monkeypatch.setattr("modelgen.runtime.rows.chunk.MOST_FILTERED", 49)
    first = made_once(RECORD, "q", "how", lambda: np.zeros(3))
    assert made_once(RECORD, "q", "how", lambda: np.zeros(3)) is not first


def test_filters_are_worked_out_once_for_all_records_that_are_filtered_alike() -> None:
    choice = FilterChoice(4, 100.0, 80.0, (5,), None, None, (), (), ())
    rows = [
        unmasked_rows(
            model_from_module(emps_rigid_qm), Record(dict.fromkeys(("q_m", "F"), samples), 1e3), choice, 5
        )
        for samples in np.random.default_rng(0).standard_normal((2, 3000))
    ]
    assert rows[0].plan.filtering is rows[1].plan.filtering
    assert matched_filtering(choice, 2e3, 5) != rows[0].plan.filtering


def test_weights_of_one_place_are_those_of_many() -> None:
    places = np.random.default_rng(1).random(5)
    alone = [dict(interpolation_weights(float(place), CLOCK_POINTS)) for place in places]
    for node, weight in interpolation_weights(places, CLOCK_POINTS):
        assert weight.tolist() == [float(one[node]) for one in alone]
    # a sample itself where the place is one, and polynomials everywhere
    assert [float(weight) for node, weight in interpolation_weights(1.0, 32) if weight] == [1.0]
    for degree in range(8):
        moved = sum(float(weight) * node**degree for node, weight in interpolation_weights(0.3, 32))
        assert moved == pytest.approx(0.3**degree, abs=1e-7)
