"""A start with which rows leave least: near the truth although a force is late and composites contradict."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.physical.start_in_rows import start_in_rows
from modelgen.runtime.iv.physical.starting_values import cheap_starts, near_composites
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import observe
from tests.runtime.iv.physical.swinging_servo import FS, TRUTH, servo
from tests.runtime.iv.physical.test_friction_rows import swinging


def farthest(values: Mapping[str, float]) -> float:
    return max(abs(values[name] / TRUTH[name] - 1.0) for name in ("J_m", "J_l", "K"))


@pytest.mark.slow
def test_it_is_near_the_truth_where_the_force_is_late() -> None:
    record = swinging().edited({"T": shift("T", 1.7)})
    setting = Setting(servo(), [record], choose_filter(servo(), [record]))
    first = fit_matched(observe(servo(), [record], setting.choice, turns=False, friction=True))
    starts = cheap_starts(near_composites(setting.model, first), setting)
    # from some that are ten times too stiff or too soft
    assert max(farthest(one) for one in starts) > 0.7
    assert min(farthest(one) for one in starts) > 0.05
    found = start_in_rows(first, setting, starts, ("T",))
    without = start_in_rows(first, setting, starts, ())
    assert found is not None
    assert without is not None
    assert farthest(found[0]) < 0.01
    assert found[1]["T"] * FS == pytest.approx(-1.7, abs=0.2)
    assert farthest(without[0]) > 0.03
    # those that are ten times too soft or too stiff lead there, too
    far, _ = start_in_rows(first, setting, starts[1:], ("T",)) or ({}, {})
    assert farthest(far) < 0.05


def test_where_composites_have_no_value_it_finds_nothing() -> None:
    record = swinging()
    setting = Setting(servo(), [record], choose_filter(servo(), [record]))
    first = fit_matched(observe(servo(), [record], setting.choice, turns=False, friction=True))
    assert start_in_rows(first, setting, [{**TRUTH, "K": 0.0}], ()) is None
    assert start_in_rows(first, setting, [], ("T",)) is None
