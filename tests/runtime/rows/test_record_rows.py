"""Rows made chunk by chunk are what filters of SciPy, run over the whole record, make of it."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, emps_rigid_qm, tree_positions
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Feature, Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows

FloatArray = npt.NDArray[np.float64]

RIGID = model_from_module(emps_rigid_qm)
ASYMMETRIC = model_from_module(emps_rigid_asymmetric_qm)
CHAIN = model_from_module(emps300_qm_ac)
TREE = model_from_module(tree_positions)
FS = 1000.0


def swing(n: int = 6000) -> Record:
    t = np.arange(n) / FS
    position = 0.1 * np.sin(2.0 * np.pi * 0.7 * t) + 1e-3 * np.sin(2.0 * np.pi * 11.0 * t)
    return Record({"q_m": position, "F": 50.0 * np.cos(2.0 * np.pi * 2.0 * t)}, FS, "swing")


def choice_for(record: Record) -> FilterChoice:
    return choose_filter(RIGID, [record], cutoff_hz=40.0, direction_cutoff_hz=25.0, decimation=7)


def rows_of(model: Model, record: Record, factor: int = 7, drop: int = 0, **options: int) -> RecordRows:
    return matched_rows(model, record, choice_for(record), factor, drop, **options)


def column(rows: RecordRows, name: str, row: int = 0) -> FloatArray:
    """A column of a row at all samples kept."""
    touched = rows.terms[row].columns
    return rows.lines()[row][touched.index(rows.plan.model.base_parameters.index(name))]


def close(found: FloatArray, expected: FloatArray, share: float = 1e-4) -> None:
    """Both ends continue differently beyond the record, which is felt by less than this share on the grid."""
    np.testing.assert_allclose(found, expected, atol=share * np.abs(expected).max())


def test_signals_are_filtered_then_differentiated_then_sampled() -> None:
    record = swing()
    rows = rows_of(RIGID, record)
    smooth = zero_phase(record.signals["q_m"], 4, 40.0, FS)
    close(column(rows, "M"), differentiate(smooth, 1e-3, 2)[list(rows.grid)])
    close(column(rows, "Fv"), differentiate(smooth, 1e-3)[list(rows.grid)])
    force = zero_phase(record.signals["F"], 4, 40.0, FS)
    close(rows.lines()[0][-1], force[list(rows.grid)])
    slope = rows.derivatives("F", [1, 2])
    for times in (1, 2):
        close(slope[:, times - 1], differentiate(force, 1e-3, times)[list(rows.grid)])


def test_the_interior_agrees_to_rounding() -> None:
    record = swing()
    rows = rows_of(RIGID, record)
    smooth = differentiate(zero_phase(record.signals["q_m"], 4, 40.0, FS), 1e-3, 2)[list(rows.grid)]
    inside = slice(100, -100)
    np.testing.assert_allclose(column(rows, "M")[inside], smooth[inside], atol=1e-10 * np.abs(smooth).max())


def test_the_sign_is_of_the_velocity_below_the_direction_cutoff_and_filtered_as_a_signal() -> None:
    record = swing()
    rows = rows_of(RIGID, record)
    slow = differentiate(zero_phase(record.signals["q_m"], 4, 25.0, FS), 1e-3)
    close(column(rows, "Fc"), zero_phase(np.sign(slow), 4, 40.0, FS)[list(rows.grid)])
    speed = rows.feature(Feature("speed", "sign", of="d1_q_m", times="d1_q_m"))
    raw = differentiate(record.signals["q_m"], 1e-3)
    close(speed, zero_phase(raw * np.sign(slow), 4, 40.0, FS)[list(rows.grid)])


def test_viscous_features_multiply_before_the_filter_and_add_up_to_the_velocity() -> None:
    record = swing()
    rows = rows_of(ASYMMETRIC, record)
    both = column(rows, "Fv_plus") + column(rows, "Fv_minus")
    velocity = column(rows_of(RIGID, record), "Fv")
    np.testing.assert_allclose(both, velocity, atol=1e-6)
    assert np.all(column(rows, "Fv_plus") >= -0.1 * np.abs(both).max())


def test_the_grid_keeps_off_both_ends_and_honours_drop() -> None:
    record = swing()
    rows = rows_of(RIGID, record)
    edge = rows.grid[0]
    assert edge > 100
    assert record.n - 7 - edge <= rows.grid[-1] < record.n - edge
    assert rows.grid.step == 7
    assert rows_of(RIGID, record, drop=1000).grid[0] == 1000
    assert rows_of(RIGID, record, drop=10).grid[0] == edge


def test_what_happens_beyond_the_ends_is_not_felt_on_the_grid() -> None:
    longer = swing(8000)
    cut = Record({key: samples[1000:7000] for key, samples in longer.signals.items()}, FS)
    whole, part = rows_of(RIGID, longer, factor=1), rows_of(RIGID, cut, factor=1)
    first = part.grid[0] + 1000 - whole.grid[0]
    close(column(part, "M"), column(whole, "M")[first : first + len(part.grid)])


@pytest.mark.parametrize("samples", [200, 1000, 6000])
def test_chunks_do_not_change_the_rows(samples: int) -> None:
    record = swing()
    whole, cut = rows_of(ASYMMETRIC, record), rows_of(ASYMMETRIC, record, samples=samples)
    assert whole.survey == cut.survey
    for one, other in zip(whole.lines(), cut.lines(), strict=True):
        scale = np.abs(one).max(axis=1, keepdims=True)
        np.testing.assert_allclose(other / scale, one / scale, atol=1e-12)
    np.testing.assert_allclose(cut.derivatives("F", [1]), whole.derivatives("F", [1]), rtol=1e-9, atol=1e-9)


def test_directions_are_made_once_for_all_chunks_and_cut_offs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.runtime.rows.chunk.DIRECTION_PART", 1500)
    record = swing()
    choice = replace(choice_for(record), cutoff_hz=30.0)
    chunked, other = rows_of(RIGID, record, samples=700), matched_rows(RIGID, record, choice, 7)
    key = next(iter(chunked.plan.directions))
    whole = chunked.plan.direction(next(chunked.chunks()), key, 0, record.n)
    for rows in (chunked, other):
        for chunk in rows.chunks():
            found = chunk.direction(key, chunk.start, chunk.stop)
            np.testing.assert_allclose(found, whole[chunk.start : chunk.stop], atol=1e-12)
    kept = [one for one in record.facts.channels["q_m"].filtered._found.values() if len(one) >= 1500]
    assert len(kept) == record.n // 1500
    # of a record that is read in stretches nothing is kept
    there = rows_of(RIGID, Record.over(record), samples=700)
    for chunk in there.chunks():
        found = chunk.direction(key, chunk.start, chunk.stop)
        np.testing.assert_allclose(found, whole[chunk.start : chunk.stop], atol=1e-12)
    assert not there.source.facts.channels["q_m"].filtered._found


def test_a_constant_that_an_early_row_alone_holds_is_there_for_the_later_ones() -> None:
    rng = np.random.default_rng(3)
    record = Record({key: rng.standard_normal(3000) for key in TREE.channels}, 1000.0)
    holds = [any(key == "1" for t in row.values() for _, key in t) for row in TREE.regressor_columns]
    assert True in holds[:-1]
    assert not holds[-1]
    choice = choose_filter(TREE, [record], cutoff_hz=100.0, direction_cutoff_hz=50.0)
    assert {block.row for block in observe(TREE, [record], choice).blocks} == set(range(len(TREE.rows)))


def test_a_short_record_is_refused_with_the_number_needed() -> None:
    short = swing(200)
    with pytest.raises(DataError, match=r"swing: has 200 samples; a filter of 40 Hz needs at least \d+"):
        rows_of(RIGID, short)
    needed = 2 * rows_of(RIGID, swing()).grid[0] + 7 * 5
    assert len(rows_of(RIGID, swing(needed)).grid) == 5


def test_an_accelerometer_is_differentiated_from_its_own_reading() -> None:
    rng = np.random.default_rng(0)
    record = Record({key: rng.standard_normal(3000) for key in CHAIN.channels}, 5000.0)
    choice = choose_filter(CHAIN, [record], cutoff_hz=300.0, direction_cutoff_hz=100.0)
    rows = matched_rows(CHAIN, record, choice, 1)
    load = next(index for index, info in enumerate(CHAIN.rows) if info.bodies == ("c",))
    found = column(rows, "J_c", load)
    expected = differentiate(zero_phase(record.signals["a_c"], 6, 300.0, 5000.0), 2e-4, 2)[list(rows.grid)]
    np.testing.assert_allclose(found[200:-200], expected[200:-200], atol=1e-9 * np.abs(expected).max())


def test_threads_share_chunks_where_loops_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.runtime.numerics.threads.usable_threads", lambda: 2)
    rows = rows_of(RIGID, swing(), samples=700)
    compiled = replace(rows, plan=replace(rows.plan, fast=True))
    for one, others in ((rows, False), (compiled, True)):
        workers = list(one.over_chunks(lambda _: threading.get_ident()))
        assert len(workers) > 3
        assert (threading.get_ident() not in workers) == others
