"""Triangles in place of rows give the solution that the rows give."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, three_mass_qa_qb_ac, tree_positions, two_mass_bench_qm_qc
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.least_squares.wls import fit_matched, solve_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.numerics.qr_triangle import tall_triangle
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.record_rows import matched_rows
from modelgen.runtime.rows.row_triangles import RowTriangle, observe_triangles, row_triangles
from modelgen.runtime.simulation.simulate import simulate

CHAINS = (emps300_qm_qc, emps300_qm_ac, two_mass_bench_qm_qc, three_mass_qa_qb_ac, tree_positions)


@pytest.mark.parametrize("module", CHAINS)
def test_solution_and_sizes_are_those_of_the_rows(module: ModuleType) -> None:
    model, rng = model_from_module(module), np.random.default_rng(5)
    truth = next(iter(model.parameter_sets.values()))
    records = []
    for kind in ("chirp", "trapezoid"):
        clean = simulate(model, truth, kind, duration_s=3.0, fs=2000.0, oversample=4).record
        noisy = {k: s + 1e-5 * np.ptp(s) * rng.standard_normal(clean.n) for k, s in clean.signals.items()}
        records.append(Record(noisy, clean.fs, kind))
    choice = choose_filter(model, records, cutoff_hz=60.0)
    observation = observe(model, records, choice)
    fit = fit_matched(observation)
    rows = observe_triangles(model, records, choice, surveys=observation.surveys)
    found = solve_matched(rows, model.base_parameters)
    assert found.columns == fit.columns
    spread = np.sqrt(np.diag(fit.solution.inverse))
    # the weights are inverse residuals, so that this is in standard deviations
    assert np.all(np.abs(found.solution.x - fit.solution.x) < 1e-6 * spread)
    x = np.linspace(1.0, 2.0, len(model.base_parameters))
    for triangle, block in zip(rows, observation.blocks, strict=True):
        assert (triangle.count, triangle.has_force) == (len(block.place), block.has_force)
        assert triangle.force_scale == pytest.approx(block.force_scale, rel=1e-12)
        assert triangle.residual_norm(x) == pytest.approx(float(np.linalg.norm(block.residual(x))), rel=1e-9)
        assert triangle.terms_norm(x) == pytest.approx(block.terms_norm(x), rel=1e-9)


def test_a_constant_is_put_behind_the_columns_of_a_row() -> None:
    rng = np.random.default_rng(0)
    W, y = rng.standard_normal((50, 3)), rng.standard_normal(50)
    row = RowTriangle(0, 0, 50, 50, True, 1.0, tall_triangle(W, y), np.array([0, 1, 4]))
    found = row.about_constant(7)
    assert found.touched is not None and found.touched.tolist() == [0, 1, 4, 7]
    every = np.column_stack([W, np.ones(50)])
    x = np.linalg.lstsq(every, y)[0]
    wide = np.zeros(8)
    wide[found.touched] = x
    assert found.residual_norm(wide) == pytest.approx(float(np.linalg.norm(y - every @ x)), rel=1e-12)
    assert found.terms_norm(wide) == pytest.approx(row.terms_norm(wide), rel=1e-12)


def test_memory_does_not_grow_with_the_number_of_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    # how many chunks threads have at work at a time is chance
    monkeypatch.setattr("modelgen.runtime.numerics.threads.usable_threads", lambda: 1)
    model = model_from_module(emps300_qm_qc)
    clean = simulate(
        model, next(iter(model.parameter_sets.values())), "chirp", duration_s=8.0, fs=5000.0, oversample=2
    ).record
    # files are read in stretches, and nothing of their channels is kept
    record = Record.over(EditedChannels(clean, clean.name, clean.n))
    choice = choose_filter(model, [clean], cutoff_hz=400.0)
    rows = matched_rows(model, record, choice, choice.decimation[0], samples=256)
    peaks = []
    for part in (0.5, 0.5, 1.0):  # the first loads the code
        some = replace(rows, grid=rows.grid[: int(part * len(rows.grid))])
        tracemalloc.start()
        try:
            found = row_triangles(some, 0)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    chunks, triangle = len(rows.grid) // (256 // choice.decimation[0]), found[0].triangle
    assert chunks > 100
    # half of the chunks are more than in the run before: only a bit a sample of each is kept, no triangles
    assert peaks[2] - peaks[1] < len(found) * triangle.nbytes * chunks / 2
