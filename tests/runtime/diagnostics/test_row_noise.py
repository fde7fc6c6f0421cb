"""Rows without a force that weigh little: whether values within the intervals explain them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.diagnostics.residual_tests import residual_tests
from modelgen.runtime.diagnostics.row_noise import hardly_weighed, rounded_motion, row_noise
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from tests.runtime.least_squares.row_blocks import block
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, rigid_record, swings

COUNT, TRUTH = 2000, {"J": 0.4, "I": 0.06, "m": 0.05, "K": 8000.0}


def fit_of(seed: int, right: bool = True, weight: float = 0.05) -> Fit:
    """Return a fit of y = J a + I e + m f + K d, and 0 = I a + m b - K d, the second row of `weight`.

    That of a link behind its spring, of which the first row knows little. Where it is not `right`,
    deflections of the second row are none of this motion.
    """
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(COUNT)
    a, b, none = np.sin(2.0 * t), np.sin(5.0 * t), np.zeros(COUNT)
    e, f = 0.1 * np.sin(3.0 * t), 0.1 * np.sin(7.0 * t)
    d = (TRUTH["I"] * a + TRUTH["m"] * b) / TRUTH["K"]
    seen = (d if right else 1e-5 * np.sin(9.0 * t)) + 5e-7 * rng.standard_normal(COUNT)
    y = TRUTH["J"] * a + TRUTH["I"] * e + TRUTH["m"] * f + TRUTH["K"] * d + 0.3 * rng.standard_normal(COUNT)
    rows = block(np.c_[a, e, f, d], y), block(np.c_[none, a, b, -seen], none, 1, has_force=False)
    fit = fit_matched(Observation(tuple(TRUTH), rows))
    weights = (1.0 / 0.3, weight)
    weighted = np.vstack([w * one.W for w, one in zip(weights, rows, strict=True)])
    inverse = np.linalg.inv(weighted.T @ weighted)
    x = inverse @ weighted.T @ np.r_[weights[0] * y, none]
    solution = replace(fit.solution, x=x, inverse=inverse)
    return replace(fit, weights=weights, solution=solution, residuals=residuals_of(fit.blocks, x))


@pytest.mark.parametrize("seed", [5, 9])
def test_values_within_the_intervals_explain_what_the_fit_does_not(seed: int) -> None:
    fit = fit_of(seed)
    assert (fit.unexplained(1) or 0.0) > 0.9
    assert hardly_weighed(fit, 1)
    assert not hardly_weighed(fit, 0)


@pytest.mark.slow
def test_they_do_nineteen_times_of_twenty_and_never_where_the_row_does_not_hold() -> None:
    assert sum(hardly_weighed(fit_of(seed), 1) for seed in range(100)) > 90
    assert not any(hardly_weighed(fit_of(seed, right=False), 1) for seed in range(100))


@pytest.mark.parametrize("force", [0.0, 60.0])
def test_what_an_encoder_rounds_in_moves_with_rests_is_no_more_than_noise(force: float) -> None:
    motion, step = swings((0.4, 0.2), (0.4 / 3.0, 0.62)), 1e-4
    exact = rigid_record(
        motion, n=12_000, noise=0.0, force_noise=0.02, extra=lambda q, v, a: force * np.sin(400.0 * q)
    )
    rounded = {**exact.signals, "q_m": step * np.round(exact.signals["q_m"] / step)}
    record = Record(rounded, FS, "run")
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    moved = rounded_motion(fit, 0, record, CHOICE)
    factor = CHOICE.decimation[0]
    floor = row_noise(RIGID, record, CHOICE, factor, 0, fit.solution.x)
    noise = row_noise(RIGID, record, CHOICE, factor, 0, fit.solution.x, moved)
    assert noise > 1.2 * floor
    (test,) = residual_tests(RIGID, [record], CHOICE, fit, {})
    if force:
        assert not test.is_white
    else:
        assert fit.rms(0) == pytest.approx(noise, rel=0.2)
        assert test.is_white
