"""A solution that is found again with other filters."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.solution import fitted
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.least_squares.delays import with_holds
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from tests.runtime.two_mass_records import FS, SMALL, two_mass_records


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 7.0, 30.0])
def test_delays_stay_with_other_filters_also_beside_an_effect(late: float) -> None:
    records = two_mass_records(late={"Gamma_m": late, "q_c": 0.25})
    task, solution = fitted(prepared(SMALL, records, Auto(), Filters(), CheckOptions()))
    assert [effect.name for effect in task.job.effects] == ["delay of q_c"]
    assert solution.delays["Gamma_m"] == pytest.approx(late / FS, abs=0.01 / FS)
    spread = np.sqrt(np.diag(hac_covariance(solution.fit)))
    for factor in (0.7, 1.4):
        other = solution.at(task, replace(task.choice, cutoff_hz=factor * task.choice.cutoff_hz))
        assert other.columns == solution.fit.columns
        np.testing.assert_array_less(np.abs(other.solution.x - solution.fit.solution.x), 3.0 * spread)


def test_a_change_makes_one_record_of_one() -> None:
    """What is found of a record, as its spectra, stays with it: rows and checks are to look at the same."""
    task = prepared(SMALL, two_mass_records(), Auto(), Filters(), CheckOptions())
    assert task.job.records[0] is task.records[0]
    held = task.changed(partial(with_holds, channels=(SMALL.actuators[0].key,)))
    assert held.records[0] is not task.records[0]
    assert held.job.records[0] is held.records[0]
