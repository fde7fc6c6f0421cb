"""Fits in which effects that the model lacks are estimated with the parameters and with delays."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv import divergence, effect, freed_effects
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import Freed, fit_with_effects
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from tests.runtime.two_mass_records import FS, RAMPS, SMALL, TRUTH, two_mass_records

EFFECTS = {effect.name: effect for effect in effects_of(SMALL, ("m", "c"), RAMPS)}
LATE = EFFECTS["delay of q_c"]


@cache
def started(samples: float, force: float) -> tuple[Job, Fit]:
    """Records whose load encoder and force are late, and their fit that knows of the force only."""
    records = tuple(two_mass_records(late={"q_c": samples, "Gamma_m": force}))
    job = Job(SMALL, records, choose_filter(SMALL, records), late=("Gamma_m",))
    return job, METHODS["iv"].run(job)[1]


def freed(samples: float, *effects: Effect, force: float = 0.0, known: tuple[float, ...] = ()) -> Freed:
    job, fit = started(samples, force)
    setting = Setting(SMALL, job.records, job.choice)
    return fit_with_effects(setting, job.calm, fit, effects, known=known)


def assert_truth_inside(found: Freed) -> None:
    spread = np.sqrt(np.diag(hac_covariance(found.fit)))
    truth = np.array([TRUTH[name] for name in found.fit.columns])
    np.testing.assert_array_less(np.abs(found.fit.solution.x - truth), 3.0 * spread)


@pytest.mark.parametrize("force", [0.0, 3.0])
@pytest.mark.parametrize("samples", [0.25, -0.25])
def test_a_late_encoder_comes_out_with_its_standard_deviation(samples: float, force: float) -> None:
    found = freed(samples, LATE, force=force)
    assert abs(found.sizes[0] - samples / FS) < 3.0 * found.stds[0]
    assert found.stds[0] < 0.01 / FS
    ((channel, delay, std),) = found.fit.delays
    assert channel == "Gamma_m"
    assert abs(delay - force / FS) < 3.0 * std
    assert_truth_inside(found)


def test_an_effect_that_is_not_there_has_no_size_and_moves_nothing() -> None:
    found = freed(0.0, LATE)
    assert abs(found.sizes[0]) < 3.0 * found.stds[0]
    assert_truth_inside(found)


def test_from_known_sizes_the_same_comes_out() -> None:
    first = freed(0.25, LATE)
    again = freed(0.25, LATE, known=first.sizes)
    assert abs(again.sizes[0] - first.sizes[0]) < 0.2 * first.stds[0]
    spread = np.sqrt(np.diag(hac_covariance(first.fit)))
    np.testing.assert_array_less(np.abs(again.fit.solution.x - first.fit.solution.x), 0.2 * spread)


def test_rows_lack_what_effects_add_and_columns_are_free_of_them() -> None:
    found = freed(0.25, LATE)
    assert len(found.others) == 2
    stacked = [np.concatenate([w * part for w, part in zip(found.fit.weights, one, strict=True)])
               for one in found.others]  # fmt: skip
    R = np.concatenate([w * r.dense() for w, r in zip(found.fit.weights, found.fit.regressors, strict=True)])
    for other in stacked:
        angle = R.T @ other / np.linalg.norm(R, axis=0) / np.linalg.norm(other)
        np.testing.assert_allclose(angle, 0.0, atol=1e-8)


def test_sizes_that_run_away_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(effect, "LARGEST_LAG", 0.1)
    with pytest.raises(IdentifiabilityError, match="delay of q_c runs away"):
        freed(0.25, LATE)


def test_few_samples_tell_nothing_of_an_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    started(0.25, 0.0)  # the fit without effects, which has samples enough
    monkeypatch.setattr(divergence, "SAMPLES_AN_UNKNOWN", 1_000_000)
    with pytest.raises(IdentifiabilityError, match="samples are left for 8 unknowns"):
        freed(0.25, LATE)


def test_effects_that_do_not_come_to_rest_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(freed_effects, "EFFECT_ROUNDS", 1)
    with pytest.raises(IdentifiabilityError, match="with delay of q_c it does not come to rest"):
        freed(0.25, LATE)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [60.0, -60.0])
def test_an_encoder_that_is_far_out_of_step_is_no_small_effect(samples: float) -> None:
    job, fit = started(0.25, 0.0)
    records = tuple(two_mass_records(late={"q_c": samples}))
    with pytest.raises(IdentifiabilityError):
        fit_with_effects(Setting(SMALL, records, job.choice), job.calm, fit, (LATE,))
