"""What pushes change in rows is the same in time, through filters, as at all frequencies at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect_rows import simulated_records
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.pushed_chain import Pushed
from modelgen.runtime.iv.pushed_rows import PushedRows
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.rows.record_rows import RecordRows, unmasked_rows
from modelgen.runtime.rows.row_terms import mismatch_terms
from tests.runtime.two_mass_records import SMALL, two_mass_records


@pytest.fixture(scope="module")
def simulated() -> tuple[Simulated, RecordRows, list[dict[str, float]]]:
    """A simulated record, how its signals are filtered, and the sums of signals in its rows."""
    records = tuple(two_mass_records(noise=1e-3))
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit = METHODS["wls"].run(job)[1]
    one = simulated_records(fit, Setting(SMALL, records, job.choice))[0]
    rows = unmasked_rows(SMALL, one.record, job.choice, job.choice.decimation[0])
    every = mismatch_terms(SMALL, fit.all_parameters(SMALL.base_parameters))
    return one, rows, [{key: w for key, w in row.items() if key in rows.plan.signals} for row in every]


@pytest.mark.parametrize("push", [[1.0, 0.0], [0.0, 1.0], [1.0, -1.0]])
def test_rows_feel_a_push_as_they_do_in_time(
    simulated: tuple[Simulated, RecordRows, list[dict[str, float]]], push: list[float]
) -> None:
    one, rows, terms = simulated
    pushed = Pushed(one, np.array(push), np.sign(one.led["m"].speed))
    added = replace(rows, source=EditedChannels(one.record, one.record.name, one.record.n, dict(pushed)))
    expected, found = added.mixed(terms), PushedRows(rows).mixed(pushed, terms)
    inside = slice(found.shape[1] // 4, -found.shape[1] // 4)
    # ends are felt as far as the rows themselves feel those of the record
    assert np.max(np.abs(found)) > 0.5
    assert np.max(np.abs(found - expected)) < 1e-5
    assert np.max(np.abs(found - expected)[:, inside]) < 1e-9


def test_what_was_found_for_one_push_is_not_taken_for_another(
    simulated: tuple[Simulated, RecordRows, list[dict[str, float]]],
) -> None:
    one, rows, _ = simulated
    kept, terms = PushedRows(rows), [{key: 1.0} for key in rows.plan.signals]
    ways = [Pushed(one, np.array(push), one.led["m"].speed) for push in ([1.0, 0.0], [0.0, 1.0], [1.0, 0.0])]
    first, other, again = (kept.mixed(way, terms) for way in ways)
    np.testing.assert_array_equal(first, again)
    assert np.max(np.abs(first - other)) > 0.1 * np.max(np.abs(first))
