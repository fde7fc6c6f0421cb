"""Rows that take directions near reversals from their record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.rows.given_directions import direction_channel, with_given_directions
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.record_rows import unmasked_rows
from tests.runtime.rows.test_observation import QC, moving


def test_a_direction_takes_the_place_of_a_sign_in_its_column_alone() -> None:
    record = moving(QC, True)
    choice = choose_filter(QC, [record])
    given = record.edited({direction_channel("m"): np.sin(np.arange(record.n) / 50.0)})
    rows = observe(QC, [record], choice)
    found = with_given_directions(rows, QC, [given], choice, 0, every=True).blocks[0]
    before, friction = rows.blocks[0], QC.base_parameters.index("F_sm")
    lines = unmasked_rows(QC, given, choice, choice.decimation[0])
    np.testing.assert_allclose(
        found.W[:, friction], lines.derivatives("direction of m", (0,))[before.place, 0], atol=1e-9
    )
    others = [place for place in range(before.W.shape[1]) if place != friction]
    np.testing.assert_array_equal(found.W[:, others], before.W[:, others])
    # rows of samples far from reversals know the sign themselves, and a record may bring none
    assert with_given_directions(rows, QC, [given], choice, 0).blocks[0] is before
    assert with_given_directions(rows, QC, [record], choice, 0, every=True).blocks[0] is before
    turning = replace(rows, blocks=(replace(before, turning=True),))
    again = with_given_directions(turning, QC, [given], choice, 0).blocks[0]
    np.testing.assert_array_equal(again.W, found.W)
