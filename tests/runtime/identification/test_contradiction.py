"""What cannot be negative, and is by many deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.contradiction import below_zero, contradiction, with_impossible_signs
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import fit_matched
from tests.runtime.two_mass_records import SMALL, two_mass_records


def test_a_negative_stiffness_counts_in_deviations_that_hold_what_is_known_to_move_it() -> None:
    records = tuple(two_mass_records())
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit = fit_matched(job.calm(records))
    c, place = len(fit.columns), fit.columns.index("K")
    none = np.zeros((c, c))
    assert below_zero(SMALL, fit, none) == {}
    spread = float(np.sqrt(hac_covariance(fit)[place, place]))
    x = fit.solution.x.copy()
    x[place] = -9.0 * spread
    wrong = replace(fit, solution=replace(fit.solution, x=x))
    # the covariance is of the residuals that the fit was left with
    assert below_zero(SMALL, wrong, none) == {"K": pytest.approx(9.0)}
    drift = none.copy()
    drift[place, place] = 8.0 * spread**2
    assert below_zero(SMALL, wrong, drift) == {"K": pytest.approx(3.0)}
    found = Explained(job.calm(records), wrong, (), (), none, ())
    told = with_impossible_signs(SMALL, found, ())
    assert [(one.kind, one.where) for one in told.advice] == [("negative", "K")]
    np.testing.assert_allclose(told.drift, 4.5**2 * hac_covariance(wrong))
    # what is refused shows nothing
    assert with_impossible_signs(SMALL, found, {"K"}) is found


def test_what_all_samples_would_show_is_a_contradiction_in_a_share_of_them() -> None:
    records = tuple(two_mass_records())
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit = fit_matched(job.calm(records))
    spread = np.sqrt(2.0 * np.diag(hac_covariance(fit)))
    moved = fit.solution.x + 2.0 * spread
    other = replace(fit, solution=replace(fit.solution, x=moved))
    assert not contradiction(fit, other).any()
    assert contradiction(fit, other, 0.25) == pytest.approx(-2.0 * spread)
