"""A chain whose responses are the measured ones, with the delay of its force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.physical.response_start import response_start
from modelgen.runtime.iv.physical.starting_values import cheap_starts, near_composites
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from tests.runtime.iv.physical.test_composite_iv import motor_only, noisy

MODEL = motor_only("emps300")
TRUTH = MODEL.parameter_sets["light"]
SHAPES = ("J_m", "J_c", "K")


def farthest(values: Mapping[str, float]) -> float:
    return max(abs(values[name] / TRUTH[name] - 1.0) for name in SHAPES)


def setting_of(records: Sequence[Record]) -> tuple[Setting, Fit]:
    choice = choose_filter(MODEL, records)
    return Setting(MODEL, tuple(records), choice), fit_matched(observe(MODEL, records, choice))


@pytest.mark.parametrize("late", [0.0, pytest.param(-0.7, marks=pytest.mark.slow)])
def test_it_is_near_the_truth_though_the_force_is_late(late: float) -> None:
    records = [record.edited({"Gamma_m": shift("Gamma_m", -late)}) for record in noisy("light", 0, 5.0)]
    setting, first = setting_of(records)
    near = near_composites(setting.model, first)
    found = response_start(setting, near, ("Gamma_m",), cheap_starts(near, setting))
    assert found is not None
    assert farthest(found.values) < 0.1
    assert found.delays["Gamma_m"] * records[0].fs == pytest.approx(late, abs=0.3)
    assert found.missed < 0.2


@pytest.mark.slow
def test_the_same_record_gives_the_same_start_and_rest_gives_none() -> None:
    records = noisy("light", 0)
    setting, first = setting_of(records)
    near = near_composites(setting.model, first)
    one, other = (response_start(setting, near, ()) for _ in range(2))
    assert one == other
    rest = Record({key: np.zeros(records[0].n) for key in records[0].signals}, records[0].fs, "rest")
    assert response_start(replace(setting, records=(rest,)), near, ()) is None


def test_starts_without_numbers_and_impossible_chains_are_no_obstacle() -> None:
    setting, _ = setting_of(noisy("light", 0))
    unknown = dict.fromkeys(MODEL.parameters, np.nan)
    found = response_start(setting, unknown, (), (dict.fromkeys(MODEL.parameters, 0.0), unknown))
    assert found is not None
    assert np.all(np.isfinite(list(found.values.values())))
