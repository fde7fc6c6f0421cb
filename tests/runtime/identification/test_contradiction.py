"""What cannot be negative, and is by many deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.contradiction import below_zero, contradiction, with_impossible_signs
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_iv
from modelgen.runtime.iv.physical import composite_iv
from modelgen.runtime.iv.physical.physical_iv import PLAIN, Found
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import fit_matched
from tests.runtime.iv.physical.test_composite_iv import motor_only, noisy
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


def test_a_chain_that_cannot_be_is_taken_only_where_no_start_leads_to_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, records = motor_only("emps300"), noisy("light", 0)
    job = Job(model, tuple(records), choose_filter(model, records))
    observation, fit = run_iv(job)
    truth = model.parameter_sets["light"]
    right = Found(observation, fit, np.array(list(truth.values())), np.array(list(truth.values())))
    wrong, worse = (replace(right, below=deviations) for deviations in (20.0, 30.0))
    tried = iter((worse, wrong, right))
    monkeypatch.setattr(composite_iv, "fit_physical_iv", lambda *_: next(tried))
    beginnings = [({**truth, "K": stiffness}, {}) for stiffness in (0.1, 0.2, 0.3)]

    def first(count: int) -> Found:
        return composite_iv._first_found(job.setting(), lambda _: observation, beginnings[:count], PLAIN)

    assert first(3) is right
    tried = iter((worse, wrong))
    assert first(2) is wrong


def test_physical_parameters_below_zero_count_in_their_own_deviations() -> None:
    model, records = motor_only("emps300"), noisy("light", 0)
    job = Job(model, tuple(records), choose_filter(model, records))
    observation, fit = run_iv(job)
    assert fit.carried is not None and model.base_parameters != model.parameters
    linear, c = fit.carried.linear, len(fit.columns)
    none = np.zeros((c, c))
    assert below_zero(model, fit, none) == {}
    place = linear.columns.index("F_vm")
    spread = float(np.sqrt(hac_covariance(linear)[place, place]))
    x = linear.solution.x.copy()
    x[place] = -9.0 * spread
    shifted = replace(linear, solution=replace(linear.solution, x=x))
    wrong = replace(fit, carried=replace(fit.carried, linear=shifted))
    assert below_zero(model, wrong, none) == {"F_vm": pytest.approx(9.0, rel=0.05)}
    told = with_impossible_signs(model, Explained(observation, wrong, (), (), none, ()), ())
    assert [(one.kind, one.where) for one in told.advice] == [("negative", "F_vm")]
    assert np.all(np.diag(told.drift) > 10.0 * np.diag(hac_covariance(wrong)))
