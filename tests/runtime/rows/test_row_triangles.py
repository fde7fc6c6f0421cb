"""Triangles in place of rows give the solution that the rows give."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, three_mass_qa_qb_ac, tree_positions, two_mass_bench_qm_qc
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.least_squares.wls import fit_matched, solve_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.row_triangles import observe_triangles
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
