from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.settings_drift import (
    Attempts,
    cutoff_drift,
    direction_drift,
    load_row_drift,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock

CHOICE = FilterChoice(4, 100.0, 80.0, (5,), 80.0, 50.0, (), (), ())


def observation(noise: float) -> Observation:
    """A row with a force and one without; both hold for x = (2, 3) but for the noise."""
    rng = np.random.default_rng(0)
    a = rng.standard_normal((2, 500))
    forced = np.column_stack([a[0], a[1]])
    load = np.column_stack([3.0 * a[0], -2.0 * a[0]]) + noise * rng.standard_normal((500, 2))
    Y = forced @ np.array([2.0, 3.0]) + noise * rng.standard_normal(500)
    blocks = tuple(
        RowBlock(0, row, "run", f"row {row}", "N", np.arange(500), 500, y, W, 0, bool(np.any(y)), 3.0, 0)
        for row, (W, y) in enumerate(((forced, Y), (load, np.zeros(500))))
    )
    return Observation(("a", "b"), blocks)


def moved(fit: Fit, move: np.ndarray) -> Fit:
    return replace(fit, solution=replace(fit.solution, x=fit.solution.x + move))


def test_both_neighbouring_cutoffs_are_tried_and_their_moves_squared() -> None:
    fit, tried = fit_matched(observation(0.1)), list[float]()

    def again(choice: FilterChoice) -> Fit:
        tried.append(choice.cutoff_hz)
        assert choice.decimation == CHOICE.decimation
        return moved(fit, np.array([1.0, 0.0]) if choice.cutoff_hz < 100.0 else np.array([0.0, -2.0]))

    drift = cutoff_drift(fit, CHOICE, 1000.0, again)
    np.testing.assert_allclose(tried, [70.7107, 141.421], rtol=1e-5)
    np.testing.assert_allclose(drift, [[0.5, 0.0], [0.0, 2.0]])


def test_no_cutoff_beyond_what_sampling_allows() -> None:
    fit, tried = fit_matched(observation(0.1)), list[float]()

    def again(choice: FilterChoice) -> Fit:
        tried.append(choice.cutoff_hz)
        return fit

    cutoff_drift(fit, CHOICE, 300.0, again)
    cutoff_drift(fit, CHOICE, 250.0, again)
    np.testing.assert_allclose(tried, [70.7107, 120.0, 70.7107], rtol=1e-5)


def test_a_cutoff_for_which_the_record_is_too_short_does_not_count() -> None:
    fit = fit_matched(observation(0.1))

    def again(choice: FilterChoice) -> Fit:
        if choice.cutoff_hz < 100.0:
            raise DataError.at("run", "is too short", "make it longer")
        return moved(fit, np.array([3.0, 0.0]))

    np.testing.assert_allclose(cutoff_drift(fit, CHOICE, 1000.0, again), [[9.0, 0.0], [0.0, 0.0]])


def test_a_fit_to_other_columns_does_not_count() -> None:
    fit = fit_matched(observation(0.1))
    other = replace(moved(fit, np.ones(2)), columns=("a", "c"))
    np.testing.assert_array_equal(cutoff_drift(fit, CHOICE, 1000.0, lambda _: other), 0.0)


def test_the_weight_of_load_rows_matters_only_with_noise() -> None:
    drift = {
        noise: load_row_drift(fit_matched(observation(noise)), observation(noise)) for noise in (0.0, 0.5)
    }
    assert np.abs(drift[0.0]).max() < 1e-20
    assert np.diag(drift[0.5]).min() > 1e-6


def test_without_load_rows_there_is_no_such_drift() -> None:
    both = observation(0.5)
    forced = replace(both, blocks=both.blocks[:1])
    np.testing.assert_array_equal(load_row_drift(fit_matched(forced), forced), 0.0)


def test_settings_that_say_nothing_are_told_with_the_reason() -> None:
    fit = fit_matched(observation(0.1))

    def again(choice: FilterChoice) -> Fit:
        if choice.direction_cutoff_hz > 80.0:
            raise IdentifiabilityError.at("rows", "nothing is left", "move")
        if choice.cutoff_hz < 100.0:
            raise DataError.at("run", "is too short", "make it longer")
        return replace(fit, columns=("a", "c"))

    attempts = Attempts(again, CHOICE, fit.columns)
    assert not attempts.notes
    np.testing.assert_array_equal(cutoff_drift(fit, CHOICE, 1000.0, attempts), 0.0)
    np.testing.assert_array_equal(direction_drift(fit, CHOICE, 1000.0, attempts), 0.0)
    (note,) = attempts.notes
    for said in (
        "at 70.71 Hz (run is too short)",
        "at 141.4 Hz (no column for b)",
        "with directions below 160 Hz (rows nothing is left)",
    ):
        assert said in note


def test_settings_that_can_be_compared_leave_no_note() -> None:
    fit = fit_matched(observation(0.1))
    attempts = Attempts(lambda _: fit, CHOICE, fit.columns)
    cutoff_drift(fit, CHOICE, 1000.0, attempts)
    assert attempts.notes == ()
