"""Least squares in place of instruments: intervals hold what only these know; long records of arms."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from modelgen import Record, identify
from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.explanation import least_squares_instead, search
from modelgen.runtime.identification.explanation.drive_noise import DriveBias
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.thresholds import MOST_EFFECTS, SEARCHED
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from tests.runtime.made_arm_records import catalogued, model_of, of_bodies, record_of
from tests.runtime.two_mass_records import SMALL, TRUTH, assert_truth_inside, curved, two_mass_records

LATE_S = 2e-3


@lru_cache(maxsize=1)
def arm() -> tuple[Model, dict[str, float], Record]:
    model = model_of(catalogued("two_link"))
    values = of_bodies(model)
    record = record_of(model, values, seconds=400.0, noise=(1e-5, 0.1))
    assert record.n > SEARCHED
    return model, values, record


@pytest.mark.slow
def test_long_records_of_arms_take_least_squares_and_their_intervals_hold() -> None:
    model, values, record = arm()
    estimate = identify(model, record)
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    assert estimate.fit.method == "wls"
    assert "hardly biases these long records" in estimate.fit.notes[0]
    errors = [(value - exact[name]) / estimate.bse[name] for name, value in estimate.params.items()]
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


@pytest.mark.slow
def test_a_late_force_is_left_to_instruments() -> None:
    model, _, record = arm()
    late = advanced(record, {"tau_1": -LATE_S})
    estimate = identify(model, late)
    assert estimate.fit.method == "iv"
    assert estimate.delays["tau_1"] == pytest.approx(LATE_S, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("most_effects", [0, MOST_EFFECTS], ids=["held", "estimated"])
def test_where_noise_of_the_forces_speaks_for_least_squares_the_intervals_hold_what_only_instruments_know(
    monkeypatch: pytest.MonkeyPatch, most_effects: int
) -> None:
    def little(job: Job, method: Method, fit: Fit) -> DriveBias:
        c = len(fit.columns)
        return DriveBias(1e-9 * fit.solution.x, np.zeros(len(fit.delays)), np.zeros((c, c)), 0.0)

    def none(model: Model, records: list[Record], choice: FilterChoice, fit: Fit) -> FloatArray:
        return np.zeros(len(fit.columns))

    monkeypatch.setattr(search, "MOST_EFFECTS", most_effects)
    monkeypatch.setattr(default_method, "driven_by_noise", little)
    monkeypatch.setattr(default_method, "exceeding", lambda first: False)
    monkeypatch.setattr(least_squares_instead, "noise_bias", none)
    estimate = identify(SMALL, curved(two_mass_records(), "Gamma_m", "cube", 0.05))
    assert estimate.fit.method == "wls"
    assert any("the intervals hold what that moves" in one.what for one in estimate.checks.advice)
    assert_truth_inside(estimate, TRUTH)
