"""Blocks that are made again are those that are kept, whatever stretch of whichever row is asked for."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generated import emps300_qm_ac, tree_positions
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.model.model import Feature, model_from_module
from modelgen.runtime.rows.observation import Observation, observe
from modelgen.runtime.rows.record_rows import matched_rows
from modelgen.runtime.rows.remade_rows import RemadeFeature
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.simulate import simulate

MODULES = (emps300_qm_ac, tree_positions)
CHUNK = 700


@cache
def observations(index: int) -> tuple[Observation, Observation]:
    """Rows that are kept, and the same made again; in chunks that are shorter than any stretch in use."""
    model = model_from_module(MODULES[index])
    truth = next(iter(model.parameter_sets.values()))
    record = simulate(model, truth, "trapezoid", duration_s=2.0, fs=2000.0, oversample=4).record
    choice = choose_filter(model, [record], cutoff_hz=100.0, decimation=2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", CHUNK)
        patch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
        kept = observe(model, [record], choice)
        kept = replace(kept, blocks=tuple(block.dense(len(kept.columns)) for block in kept.blocks))
        return kept, observe(model, [record], choice, memory_limit=1.0)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.integers(0, 1), st.data())
def test_any_stretch_of_any_row_and_columns(index: int, data: st.DataObject) -> None:
    kept, remade = observations(index)
    row = data.draw(st.integers(0, len(kept.blocks) - 1))
    columns = data.draw(st.lists(st.integers(0, len(kept.columns) - 1), min_size=1, unique=True).map(sorted))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", CHUNK)
        patch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
        mine, other = kept.blocks[row].chosen(columns), remade.blocks[row].chosen(columns)
        assert mine.in_memory
        assert not other.in_memory
        start = data.draw(st.integers(0, mine.grid))
        stop = data.draw(st.integers(start, mine.grid + 5))
        most = data.draw(st.integers(1, 2 * mine.grid))
        for one, again in (
            (mine.between(start, stop), other.between(start, stop)),
            (mine.longest_run(most), other.longest_run(most)),
        ):
            W = np.zeros((len(again.Y), len(columns)))
            W[:, slice(None) if other.touched is None else other.touched] = again.W
            np.testing.assert_array_equal(again.place, one.place)
            np.testing.assert_array_equal(again.Y, one.Y)
            np.testing.assert_array_equal(W, one.W)
            assert (again.rows.stop - again.rows.start) == len(one.Y)
            if len(one.Y):
                assert again.rows == one.rows


@pytest.mark.parametrize("index", range(len(MODULES)))
def test_whole_blocks_and_their_summaries(index: int) -> None:
    kept, remade = observations(index)
    assert index or any(block.masked for block in kept.blocks)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", CHUNK)
        patch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
        for one, again in zip(kept.blocks, remade.blocks, strict=True):
            whole = again.kept().dense(len(kept.columns))
            for field in fields(RowBlock):
                mine, theirs = getattr(one, field.name), getattr(whole, field.name)
                if isinstance(mine, float):
                    assert theirs == pytest.approx(mine, rel=1e-12)
                else:
                    np.testing.assert_array_equal(theirs, mine)
            assert again.count == one.count
            x = np.random.default_rng(index).standard_normal(len(kept.columns))
            np.testing.assert_allclose(again.residual(x), one.residual(x), rtol=1e-10, atol=1e-12)
            assert again.summary.residual_norm(x) == pytest.approx(np.linalg.norm(one.residual(x)), rel=1e-9)
            for column in range(len(kept.columns)) if one.count else ():
                assert again.column_norm(column) == pytest.approx(np.linalg.norm(one.W[:, column]), rel=1e-9)
                mean = float(np.mean(one.W[:, column]))
                scale = float(np.abs(one.W[:, column]).max())
                assert abs(again.column_mean(column) - mean) <= 1e-9 * scale


def test_a_feature_is_that_of_the_whole_record(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_from_module(emps300_qm_ac)
    truth = next(iter(model.parameter_sets.values()))
    record = simulate(model, truth, "trapezoid", duration_s=2.0, fs=2000.0, oversample=4).record
    choice = choose_filter(model, [record], cutoff_hz=100.0, decimation=2)
    monkeypatch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", CHUNK)
    monkeypatch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
    rows = matched_rows(model, record, choice, 2)
    key = next(iter(model.direction_keys))
    feature = Feature("speed", "sign", of=key, times=key)
    whole, again = rows.feature(feature), RemadeFeature(rows, feature)
    rng = np.random.default_rng(0)
    for _ in range(20):
        place = np.sort(rng.choice(len(whole), size=int(rng.integers(0, 400)), replace=False))
        np.testing.assert_array_equal(again[place], whole[place])
