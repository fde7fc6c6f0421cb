"""Long records of arms: least squares in constant memory where it knows as much as instruments."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from modelgen import Record, identify
from modelgen.runtime.identification.thresholds import SEARCHED
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.model.model import Model
from tests.runtime.made_arm_records import catalogued, model_of, of_bodies, record_of

LATE_S = 2e-3


@lru_cache(maxsize=1)
def arm() -> tuple[Model, dict[str, float], Record]:
    model = model_of(catalogued("two_link"))
    values = of_bodies(model)
    record = record_of(model, values, seconds=400.0, noise=(1e-5, 0.1))
    assert record.n > SEARCHED
    return model, values, record


def test_long_records_of_arms_take_least_squares_and_their_intervals_hold() -> None:
    model, values, record = arm()
    estimate = identify(model, record)
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    assert estimate.fit.method == "wls"
    assert "hardly biases these long records" in estimate.fit.notes[0]
    errors = [(value - exact[name]) / estimate.bse[name] for name, value in estimate.params.items()]
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


def test_a_late_force_is_left_to_instruments() -> None:
    model, _, record = arm()
    late = advanced(record, {"tau_1": -LATE_S})
    estimate = identify(model, late)
    assert estimate.fit.method == "iv"
    assert estimate.delays["tau_1"] == pytest.approx(LATE_S, rel=0.2)
