"""Rows of arms: exact where the record is, whatever the chunks, in memory or made again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, identify
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.rows.kernel_lines import inner_orders, with_inner
from modelgen.runtime.rows.record_rows import matched_rows
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of
from tests.symbolic.arms.elastic_arms import with_sensors
from tests.symbolic.arms.test_elastic_rows import both

QUICK = CheckOptions(tests=False)


def errors(model: Model, values: dict[str, float], found: dict[str, float]) -> np.ndarray:
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    assert list(found) == list(exact)
    return np.array([found[name] / exact[name] - 1.0 for name in exact])


@pytest.mark.parametrize("filters", [Filters(), Filters(cutoff_hz=10.0, signal_cutoff_hz=80.0)])
# the friction of SCARA's screw and of its motor differ near reversals only
@pytest.mark.parametrize(("name", "most"), [("two_link", 1e-6), ("scara", 2e-4)])
def test_a_record_without_noise_gives_the_truth(name: str, most: float, filters: Filters) -> None:
    model = model_of(catalogued(name))
    values = values_of(model)
    estimate = identify(model, record_of(model, values), "wls", filters, QUICK)
    off = np.abs(errors(model, values, estimate.params))
    assert off.max() < most and np.median(off) < 1e-6


def test_a_narrow_filter_of_positions_errs_and_the_default_does_not() -> None:
    model = model_of(catalogued("two_link"))
    values = values_of(model)
    record = record_of(model, values)
    narrow = identify(model, record, "wls", Filters(cutoff_hz=10.0, signal_cutoff_hz=1.2), QUICK)
    assert np.abs(errors(model, values, narrow.params)).max() > 1e-2


def test_chunks_and_rows_made_again_change_nothing() -> None:
    model = model_of(catalogued("two_link"))
    record = record_of(model, values_of(model), noise=(1e-5, 0.1))
    choice = choose_filter(model, [record])
    whole, cut = (
        matched_rows(model, record, choice, choice.decimation[0], samples=samples)
        for samples in (1 << 20, 2000)
    )
    for one, other in zip(whole.lines(), cut.lines(), strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9 * np.abs(one).max())
    kept = identify(model, record, "wls", checks=QUICK)
    remade = identify(model, record, "wls", Filters(memory_limit_mb=0.01), QUICK)
    for name, value in kept.params.items():
        assert abs(remade.params[name] - value) < 1e-7 * kept.bse[name]


def test_a_record_in_stretches_is_one_in_memory() -> None:
    model = model_of(catalogued("scara"))
    assert model.derived
    record = record_of(model, values_of(model), noise=(1e-5, 0.1))
    found = [identify(model, one, "wls", checks=QUICK).params for one in (record, Record.over(record))]
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    one, other = (with_derived(model, [one])[0] for one in (record, Record.over(record)))
    for key in model.derived:
        np.testing.assert_array_equal(one.read(key, 10, 90), other.read(key, 10, 90))


def test_slow_samples_are_left_out_as_asked() -> None:
    model = model_of(catalogued("two_link"))
    record = record_of(model, values_of(model), noise=(1e-5, 0.1))
    used = [
        [row.used for row in identify(model, record, "wls", Filters(slow_speeds=slow), QUICK).fit.rows]
        for slow in ({}, {"q_2": 0.5})
    ]
    assert used[0][0] == used[1][0] and used[1][1] < used[0][1]


MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"slow_speeds": {"q_9": 0.1}}, "q_9"),
    ({"slow_speeds": {"q_1": -1.0}}, "speed above 0"),
    ({"signal_cutoff_hz": 1e9}, "signal_cutoff_hz"),
]


@pytest.mark.parametrize(("options", "message"), MISTAKES)
def test_mistakes_of_filters_are_told(options: dict[str, Any], message: str) -> None:
    model = model_of(catalogued("two_link"))
    record = record_of(model, values_of(model), seconds=5.0)
    with pytest.raises(DataError, match=message):
        identify(model, record, "wls", replace(Filters(), **options), QUICK)


def test_lines_that_others_are_made_of_may_be_shorter_than_a_difference() -> None:
    spec = with_sensors(catalogued("elastic_two_link"), *both("link"), *both("between", "torque"))
    model = model_of(spec, sensor_set="s")
    assert model.kernel is not None
    orders = inner_orders(model.kernel)
    assert set(orders.values()) <= {0}
    known = {read: np.zeros(5) for read in model.kernel.reads if read[0] not in orders}
    stencil = tuple(np.ones(24))
    assert all(len(line) == 5 for line in with_inner(model.kernel, known, stencil, 200.0).values())
