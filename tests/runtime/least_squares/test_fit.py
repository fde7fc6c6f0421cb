from __future__ import annotations

from dataclasses import replace

import pytest

from generated import emps300_qm_qc
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.simulate import simulate

MODEL = model_from_module(emps300_qm_qc)


def test_terms_that_grow_and_cancel_do_not_count_as_a_better_fit() -> None:
    record = simulate(MODEL, MODEL.parameter_sets["table_2"], "chirp", fs=5000.0, duration_s=0.5).record
    choice = FilterChoice(4, 200.0, 200.0, (5,), 200.0, None, (), (), ())
    job = Job(MODEL, (record,), choice)
    fit = fit_matched(job.observed(job.records))
    forced = [index for index, block in enumerate(fit.blocks) if block.has_force]
    free = [index for index in range(len(fit.blocks)) if index not in forced]
    assert forced
    assert free

    def scaled(by: float, kept: list[int]) -> float:
        """Return the misfit of rows whose parameters are larger, and whose residuals are the same."""
        one = replace(
            fit,
            solution=replace(fit.solution, x=by * fit.solution.x),
            blocks=tuple(fit.blocks[index] for index in kept),
            residuals=tuple(fit.residuals[index] for index in kept),
        )
        return one.misfit

    assert scaled(3.0, forced) == pytest.approx(scaled(1.0, forced), rel=1e-12)
    # without a force, parameters that shrink to nothing leave nothing and explain nothing
    assert scaled(0.1, free) > scaled(1.0, free)


def test_parameters_by_name_are_put_together_once() -> None:
    record = simulate(MODEL, MODEL.parameter_sets["table_2"], "chirp", fs=5000.0, duration_s=0.5).record
    choice = FilterChoice(4, 200.0, 200.0, (5,), 200.0, None, (), (), ())
    job = Job(MODEL, (record,), choice)
    fit = fit_matched(job.observed(job.records))
    every = fit.all_parameters([*MODEL.base_parameters, "no column"])
    assert every.tolist() == [
        *(fit.solution.x[fit.columns.index(name)] for name in MODEL.base_parameters),
        0.0,
    ]
    # each row of a long chain asks for all of them
    assert fit.all_parameters([*MODEL.base_parameters, "no column"]) is every
    assert not every.flags.writeable
    assert fit.all_parameters(MODEL.base_parameters[:2]).tolist() == every[:2].tolist()
