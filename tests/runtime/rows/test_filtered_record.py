from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.filtered_record import FilteredRecord

RIGID = model_from_module(emps_rigid_qm)
ASYMMETRIC = model_from_module(emps_rigid_asymmetric_qm)
CHAIN = model_from_module(emps300_qm_ac)
FS = 1000.0


def swing(n: int = 6000) -> Record:
    t = np.arange(n) / FS
    position = 0.1 * np.sin(2.0 * np.pi * 0.7 * t) + 1e-3 * np.sin(2.0 * np.pi * 11.0 * t)
    return Record({"q_m": position, "F": 50.0 * np.cos(2.0 * np.pi * 2.0 * t)}, FS, "swing")


def choice_for(record: Record) -> FilterChoice:
    return choose_filter(RIGID, [record], cutoff_hz=40.0, direction_cutoff_hz=25.0, decimation=7)


def test_signals_are_filtered_then_differentiated_then_sampled() -> None:
    record = swing()
    filtered = FilteredRecord(RIGID, record, choice_for(record), 7, 0)
    smooth = zero_phase(record.signals["q_m"], 4, 40.0, FS)
    for times, key in ((1, "d1_q_m"), (2, "d2_q_m")):
        expected = differentiate(smooth, 1e-3, times)[filtered.grid]
        np.testing.assert_allclose(filtered.kept(key), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(
        filtered.kept("F"), zero_phase(record.signals["F"], 4, 40.0, FS)[filtered.grid]
    )


def test_sums_of_terms_are_sums_of_what_is_kept() -> None:
    filtered = FilteredRecord(RIGID, swing(), choice_for(swing()), 7, 0)
    expected = 2.0 * filtered.kept("F") - 3.0
    np.testing.assert_allclose(filtered.sum_of(((2.0, "F"), (-3.0, "1"))), expected)
    np.testing.assert_array_equal(filtered.sum_of(()), 0.0)


def test_the_sign_is_of_the_velocity_below_the_direction_cutoff_and_filtered_as_a_signal() -> None:
    record = swing()
    filtered = FilteredRecord(RIGID, record, choice_for(record), 7, 0)
    slow = differentiate(zero_phase(record.signals["q_m"], 4, 25.0, FS), 1e-3)
    np.testing.assert_array_equal(filtered.direction("d1_q_m"), slow)
    expected = zero_phase(np.sign(slow), 4, 40.0, FS)[filtered.grid]
    np.testing.assert_array_equal(filtered.kept("sign(d1_q_m)"), expected)


def test_viscous_features_multiply_before_the_filter_and_add_up_to_the_velocity() -> None:
    record = swing()
    filtered = FilteredRecord(ASYMMETRIC, record, choice_for(record), 7, 0)
    both = filtered.kept("forward(d1_q_m)*d1_q_m") + filtered.kept("backward(d1_q_m)*d1_q_m")
    np.testing.assert_allclose(both, filtered.kept("d1_q_m"), atol=1e-6)
    assert np.all(filtered.kept("forward(d1_q_m)*d1_q_m") >= -0.1 * np.abs(both).max())


def test_the_grid_keeps_off_both_ends_and_honours_drop() -> None:
    record = swing()
    filtered = FilteredRecord(RIGID, record, choice_for(record), 7, 0)
    assert filtered.edge > 100
    assert filtered.grid[0] == filtered.edge
    assert record.n - 7 - filtered.edge <= filtered.grid[-1] < record.n - filtered.edge
    assert set(np.diff(filtered.grid).tolist()) == {7}
    assert FilteredRecord(RIGID, record, choice_for(record), 7, 1000).grid[0] == 1000
    assert FilteredRecord(RIGID, record, choice_for(record), 7, 10).grid[0] == filtered.edge


def test_what_happens_beyond_the_ends_is_not_felt_on_the_grid() -> None:
    longer = swing(8000)
    cut = Record({key: samples[1000:7000] for key, samples in longer.signals.items()}, FS)
    choice = choice_for(cut)
    whole, part = FilteredRecord(RIGID, longer, choice, 1, 0), FilteredRecord(RIGID, cut, choice, 1, 0)
    same = whole.kept("d2_q_m")[np.searchsorted(whole.grid, part.grid + 1000)]
    scale = np.abs(same).max()
    np.testing.assert_allclose(part.kept("d2_q_m"), same, atol=1e-4 * scale)


def test_a_short_record_is_refused_with_the_number_needed() -> None:
    short = swing(200)
    with pytest.raises(DataError, match=r"swing: has 200 samples; a filter of 40 Hz needs at least \d+"):
        FilteredRecord(RIGID, short, choice_for(short), 7, 0)
    needed = 2 * FilteredRecord(RIGID, swing(), choice_for(swing()), 7, 0).edge + 7 * 5
    assert FilteredRecord(RIGID, swing(needed), choice_for(short), 7, 0).grid.size == 5


def test_an_accelerometer_is_differentiated_from_its_own_reading() -> None:
    rng = np.random.default_rng(0)
    record = Record({key: rng.standard_normal(3000) for key in CHAIN.channels}, 5000.0)
    choice = choose_filter(CHAIN, [record], cutoff_hz=300.0, direction_cutoff_hz=100.0)
    filtered = FilteredRecord(CHAIN, record, choice, 1, 0)
    smooth = zero_phase(record.signals["a_c"], 6, 300.0, 5000.0)
    np.testing.assert_allclose(filtered.kept("d2_a_c"), differentiate(smooth, 2e-4, 2)[filtered.grid])
