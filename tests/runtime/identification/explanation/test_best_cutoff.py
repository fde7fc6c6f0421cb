"""Instruments tell at which cut-off they know most; what was given, and what has little to gain, stays."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen.runtime.identification import job as jobs
from modelgen.runtime.identification.cutoffs.cutoff_steps import choice_at
from modelgen.runtime.identification.explanation import best_cutoff
from modelgen.runtime.identification.explanation.best_cutoff import (
    at_best_cutoff,
    at_white_cutoff,
    calmer,
)
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import Task, prepared
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import FS, NOISE, SMALL, TRUTH

DRIVE = {"J_m": 1e-3, "F_vm": 5e-3, "F_sm": 0.02, "J_c": 1e-3, "F_vmc": 4e-3, "K": 8.0}


@cache
def begun_at(cutoff_hz: float, kind: str = "trapezoid", noise: float = 1e-4, given: bool = False) -> Begun:
    return run_method(task_at(cutoff_hz, kind, noise, given), IV())


def task_at(cutoff_hz: float, kind: str = "trapezoid", noise: float = 1e-4, given: bool = False) -> Task:
    rms = {"q_m": noise, "q_c": noise, "Gamma_m": 2e-3}
    record = simulate(SMALL, DRIVE, kind, fs=1000.0, duration_s=4.0, noise=rms).record
    filters = Filters(cutoff_hz=cutoff_hz) if given else Filters()
    return at(prepared(SMALL, record, Auto(), filters, CheckOptions()), cutoff_hz)


def at(task: Task, cutoff_hz: float) -> Task:
    choice = choice_at(task, cutoff_hz)
    assert choice is not None
    return replace(task, choice=choice, job=replace(task.job, choice=choice))


def deviations(begun: Begun) -> np.ndarray:
    return np.sqrt(np.diag(hac_covariance(begun.found.fit)))


def test_from_a_cutoff_that_reversals_empty_instruments_go_to_one_that_knows_more() -> None:
    first = begun_at(35.0)
    best = at_best_cutoff(first)
    assert best.task.choice.cutoff_hz > 1.3 * first.task.choice.cutoff_hz
    assert best.task.job.choice is best.task.choice
    assert np.prod(deviations(best)) < 0.5 * np.prod(deviations(first))
    assert "instruments, tried at" in best.task.choice.sentences[0]
    assert best.task.job.start is first.task.job.start


def test_a_cutoff_that_was_given_stays() -> None:
    first = begun_at(30.0, given=True)
    assert at_best_cutoff(first) is first


def test_where_reversals_and_noise_take_little_the_cutoff_stays() -> None:
    first = begun_at(20.0, kind="chirp")
    assert at_best_cutoff(first) is first


@pytest.mark.slow
def test_a_trapezoid_shows_its_mode_at_cutoffs_at_which_reversals_leave_samples() -> None:
    # at the cut-off for the motion itself every sample feels a reversal: the default had refused all of it
    record = simulate(SMALL, TRUTH, "trapezoid", fs=FS, duration_s=4.0, noise=NOISE, seed=3).record
    estimate = identify(SMALL, record)
    assert set(estimate.params) == set(TRUTH)
    assert all(abs(estimate.params[name] - value) < 3.5 * estimate.bse[name] for name, value in TRUTH.items())
    assert estimate.bse["J_c"] < 0.03 * TRUTH["J_c"]


def test_only_where_every_sample_feels_a_reversal_higher_cutoffs_are_yielded() -> None:
    first = task_at(6.0)
    found = [task.choice.cutoff_hz for task in calmer(first)]
    assert len(found) == 2 and found[0] > first.choice.cutoff_hz
    assert not list(calmer(task_at(40.0)))
    assert not list(calmer(task_at(6.0, given=True)))


def test_stretches_are_white_only_where_all_samples_will_be(monkeypatch: pytest.MonkeyPatch) -> None:
    job = task_at(60.0).job
    monkeypatch.setattr(jobs, "MOST_WHITENED", 0.0)
    fit = IV.run(job)[1]
    numbers = sum(block.count * len(fit.touched(index)) for index, block in enumerate(fit.blocks))
    monkeypatch.setattr(jobs, "MOST_WHITENED", 2.0 * numbers)
    assert job.sharpened(fit).white is not None
    assert replace(job, share=0.6).sharpened(fit).white is not None
    assert replace(job, share=0.4).sharpened(fit) is fit


def instruments(task: Task) -> Begun:
    return run_method(task, IV())


@pytest.mark.parametrize(("colours", "taken"), [((1.0,), 0), ((10.0, 1.0), 1), ((10.0, 8.0, 0.5), 2)])
def test_a_residual_that_is_no_noise_leads_to_the_next_cutoff_where_it_is(
    monkeypatch: pytest.MonkeyPatch, colours: tuple[float, ...], taken: int
) -> None:
    first, begun = begun_at(20.0, kind="chirp"), list[Begun]()
    fit = first.found.fit
    if taken:  # another chain
        x = 1.5 * fit.solution.x
        first = replace(
            first, found=replace(first.found, fit=replace(fit, solution=replace(fit.solution, x=x)))
        )

    def colour(one: Begun) -> float:
        begun.extend([] if any(one is known for known in begun) else [one])
        return colours[next(place for place, known in enumerate(begun) if one is known)]

    monkeypatch.setattr(best_cutoff, "_colour", colour)
    found = at_white_cutoff(task_at(40.0, kind="chirp"), first, instruments)
    assert found.task.choice.cutoff_hz == pytest.approx(20.0 * np.sqrt(2.0) ** taken)
    assert (found is first) is (taken == 0)
    assert taken == 0 or "the residual of physical parameters is no noise" in found.task.choice.sentences[0]


def test_where_no_residual_is_noise_intervals_hold_the_difference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = begun_at(20.0, kind="chirp")
    best = instruments(at(first.task, 20.0 * np.sqrt(2.0)))
    monkeypatch.setattr(best_cutoff, "_colour", lambda begun: 8.0 + abs(begun.task.choice.cutoff_hz - 28.0))
    found = at_white_cutoff(task_at(40.0, kind="chirp"), first, instruments)
    move = best.found.fit.solution.x - first.found.fit.solution.x
    np.testing.assert_allclose(found.found.drift - first.found.drift, np.outer(move, move), rtol=0.1)
    assert found.found.fit is first.found.fit


def test_at_a_cutoff_that_was_given_no_other_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(best_cutoff, "_colour", lambda begun: 10.0)
    first = begun_at(20.0, kind="chirp")
    assert at_white_cutoff(task_at(40.0, kind="chirp", given=True), first, instruments) is first
