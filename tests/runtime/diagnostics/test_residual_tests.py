from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from modelgen.runtime.diagnostics.residual_tests import repeated_share, residual_advice, residual_tests
from modelgen.runtime.diagnostics.residual_whiteness import (
    Coloured,
    coloured,
    likely_spectrum,
    opened_bound,
    whiteness,
)
from modelgen.runtime.diagnostics.thresholds import WHITENESS_LAGS
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.left_open.open_forces import OpenForces, pulses_of
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.measured_records import bench
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, TRUTH, rigid_record, swings


def fit_of(record: Record, choice: FilterChoice = CHOICE) -> Fit:
    return METHODS["wls"].run(Job(RIGID, (record,), choice))[1]


def solution(fit: Fit) -> np.ndarray:
    return fit.solution.x


def test_filtered_noise_of_both_channels_is_called_white_as_often_as_the_bound_says() -> None:
    # as much of the residual from the encoder, differentiated twice, as from the force
    statistics, bounds = [], []
    for seed in range(40):
        record = rigid_record(n=12000, noise=2e-6, force_noise=2.0, seed=seed)
        fit = fit_of(record)
        found = coloured(RIGID, record, fit.blocks[0], fit.residuals[0], solution(fit), CHOICE)
        assert found is not None
        statistic, bound = whiteness(found)
        statistics.append(statistic)
        bounds.append(bound)
    # 20 lags: the mean of chi-square is 20, and 1 % lies above the bound
    assert np.mean(statistics) == pytest.approx(20.0, abs=4.0)
    assert sum(s > b for s, b in zip(statistics, bounds, strict=True)) <= 2


def test_a_force_that_the_model_lacks_is_not_white() -> None:
    record = rigid_record(extra=lambda q, v, a: 2.0 * np.sin(400.0 * q))
    (test,) = residual_tests(RIGID, [record], CHOICE, fit_of(record), {})
    assert test.whiteness is not None
    assert test.whiteness_bound is not None
    assert test.whiteness > 3.0 * test.whiteness_bound
    assert not test.is_noise
    (advice,) = residual_advice([test])
    assert advice.kind == "more than noise"
    assert "run, row m" in advice.where


def test_a_late_force_shows_as_correlation_with_past_inputs() -> None:
    clean = rigid_record(force_noise=0.2)
    late = Record({"q_m": clean.signals["q_m"], "F": np.roll(clean.signals["F"], 40)}, FS, "late")
    (on_time,), (found,) = (
        residual_tests(RIGID, [record], CHOICE, fit_of(record), {}) for record in (clean, late)
    )
    assert on_time.correlation is not None
    assert not on_time.correlation.significant
    assert found.correlation is not None
    assert found.correlation.significant
    assert 0.0 < found.correlation.lag_s <= 25 * 10 / FS


def test_noise_of_an_encoder_that_a_column_holds_too_is_no_more_than_noise() -> None:
    choice, truth = replace(CHOICE, decimation=(2,)), np.array([*TRUTH.values()])
    for seed in range(3):
        record = rigid_record(n=12000, noise=3e-5, force_noise=1.0, seed=seed)
        fit = fit_of(record, choice)
        left = tuple(block.residual(truth) for block in fit.blocks)
        freed = replace(fit, solution=replace(fit.solution, x=truth), residuals=left)
        (said,), (known,) = (residual_tests(RIGID, [record], choice, freed, {}, by) for by in (False, True))
        assert said.correlation is not None
        assert said.correlation.significant
        assert known.correlation is not None
        assert not known.correlation.significant


def test_the_column_and_the_lag_of_a_correlation_are_found() -> None:
    n, lag = 3000, 7
    rng = np.random.default_rng(0)
    W = rng.standard_normal((n, 4))
    noise = rng.standard_normal(n)
    past = np.concatenate([np.zeros(lag), W[:-lag, 1]])
    choice = replace(CHOICE, cutoff_hz=400.0, decimation=(1,))
    for share, significant in ((0.5, True), (0.0, False)):
        Y = W @ np.array([3.0, 2.0, 1.0, 1.0]) + noise + share * past
        block = RowBlock(0, 0, "run", "m", "N", np.arange(n), n, Y, W, 0, True, 1.0, 0)
        fit = fit_matched(Observation(RIGID.base_parameters, (block,)))
        (test,) = residual_tests(RIGID, [rigid_record(n=n)], choice, fit, {})
        assert test.correlation is not None
        assert test.correlation.significant is significant
        if significant:
            assert test.correlation.column == RIGID.base_parameters[1]
            assert test.correlation.lag_s == pytest.approx(lag / FS)
            assert test.correlation.value == pytest.approx(0.5 / np.hypot(1.0, 0.5), abs=0.06)
            # a bound for 25 lags of 4 columns of white series: about 4 standard deviations
            assert test.correlation.bound == pytest.approx(3.9 / np.sqrt(n), rel=0.15)


def test_nothing_is_said_of_a_residual_that_only_sampling_leaves() -> None:
    record = rigid_record(swings((0.4, 0.1), (0.1, 1.3), speed=2.0), noise=0.0, force_noise=1e-4)
    (test,) = residual_tests(RIGID, [record], CHOICE, fit_of(record), {})
    assert test.whiteness is None
    assert test.is_noise
    assert residual_advice([test]) == ()


def share_of(series: np.ndarray, period: float) -> float | None:
    return repeated_share(np.array_split(series, 7), len(series), period)


def test_what_repeats_in_every_period_is_told_from_noise() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(2000)
    same = np.tile(rng.standard_normal(200), 10)
    share = [share_of(noise + size * same, 200.0) for size in (0.0, 1.0, 10.0)]
    assert share[0] == pytest.approx(0.0, abs=0.04)
    assert share[1] == pytest.approx(0.5, abs=0.07)
    assert share[2] == pytest.approx(0.99, abs=0.01)
    # a period of 66 2/3 samples: three of them are 200
    assert share_of(same, 200.0 / 3.0) == pytest.approx(1.0)
    assert share_of(same, 600.0) is None
    assert share_of(same, 100.0 * np.sqrt(2.0)) is None
    gaps = np.where(np.arange(2000) % 200 < 50, np.nan, same)
    assert share_of(gaps, 200.0) == pytest.approx(1.0)


def test_the_bounds_are_those_of_all_rows_together() -> None:
    record = rigid_record()
    fit = fit_of(record)
    found = coloured(RIGID, record, fit.blocks[0], fit.residuals[0], solution(fit), CHOICE)
    assert found is not None
    assert whiteness(found, 10)[1] > whiteness(found, 1)[1]
    twice = replace(fit, blocks=fit.blocks * 2, residuals=fit.residuals * 2, weights=fit.weights * 2)
    both = residual_tests(RIGID, [record], CHOICE, twice, {})
    assert both[0].whiteness_bound == whiteness(found, 2)[1]


def test_the_bench_shows_more_than_noise_and_the_same_in_every_period(shared_data: Path) -> None:
    model, record = bench(shared_data)
    estimate = identify(model, record, **values_of("wls", drift_check=False))
    for test in estimate.checks.residuals:
        assert test.repeated is not None
        assert test.repeated > 0.9
        assert not test.is_white
    # and nothing else is found fault with
    assert {advice.kind for advice in estimate.checks.advice} == {"more than noise"}
    assert choose_filter(model, [record]) == estimate.fit.filtering


def test_whiteness_sums_the_squared_autocorrelations_of_the_whitened_lines() -> None:
    lines, one = np.random.default_rng(4).exponential(size=3000), np.ones(3000)
    statistic, _ = whiteness(Coloured(np.arange(3000.0), lines, one, one[:, None], one > 0.0, 1.0))
    angles = np.pi * (np.arange(3000) + 0.5) / 3000
    shares = [np.mean(np.cos(lag * angles) * lines) / lines.mean() for lag in range(1, WHITENESS_LAGS + 1)]
    assert statistic == pytest.approx(6000.0 * np.sum(np.square(shares)), rel=1e-9)


def test_noise_that_rows_with_open_forces_leave_is_not_called_more_than_noise() -> None:
    plain, knowing = 0, 0
    for seed in range(8):
        record = rigid_record(n=12000, noise=2e-6, force_noise=2.0, seed=seed)
        white, bound, wider = opened_whiteness(record, 15)
        plain, knowing = plain + (white > bound), knowing + (white > wider)
    assert plain > 6
    assert knowing == 0
    # what the model lacks is still found
    white, _, wider = opened_whiteness(rigid_record(extra=lambda q, v, a: 2.0 * np.sin(400.0 * q)), 60)
    assert white > 3.0 * wider


def opened_whiteness(record: Record, every: int) -> tuple[float, float, float]:
    """Return the statistic of rows that leave a force open at one of so many samples, and its bounds."""
    fit, factor = fit_of(record), CHOICE.decimation[0]
    rows = unmasked_rows(RIGID, record, CHOICE, factor)
    rng = np.random.default_rng(0)
    at = np.sort(rng.choice(np.arange(rows.grid[0], rows.grid[-1]), record.n // every, replace=False))
    opening = OpenForces(at, pulses_of(rows, CHOICE), rows.grid[0], factor).left
    run = fit.fitted(0, fit.blocks[0].longest_run(record.n)).part
    left = opening(run._replace(Y=fit.fitted(0, run).residual, W=np.zeros((len(run.place), 0))))
    found = coloured(RIGID, record, fit.blocks[0], left.Y, solution(fit), CHOICE)
    assert found is not None
    white, bound = whiteness(found)
    return white, bound, opened_bound(found, opening, run, bound)


def test_channels_whose_noise_dips_do_not_make_a_right_residual_look_coloured() -> None:
    # links behind springs: an encoder's noise has a dip, and other channels nothing at rest
    frequency_hz = np.linspace(0.25, 70.0, 279)
    shapes = np.column_stack([(1.0 - (frequency_hz / 11.9) ** 2) ** 2, (frequency_hz / 12.0) ** 4])
    for seed in range(8):
        power = shapes @ np.array([1.0, 0.1]) * np.random.default_rng(seed).exponential(1.0, 279)
        noise = likely_spectrum(shapes, power)
        found = Coloured(frequency_hz, power, noise, shapes, np.ones(279, dtype=bool), 142.0)
        statistic, bound = whiteness(found)
        # levels that took turns had left 8161
        assert statistic < bound
