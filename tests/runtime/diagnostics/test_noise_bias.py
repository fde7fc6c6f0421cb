from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generated import emps300_qm_ac
from modelgen.runtime.diagnostics.noise_bias import _without_noise, lost_in_noise, noise_bias
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.measured_records import bench, emps
from tests.runtime.rigid_motion import CHOICE, RIGID, TRUTH, kinds, rigid_record, swings

MODEL = model_from_module(emps300_qm_ac)
NOISE = {"q_m": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}


def noisy(clean: Record, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    signals = {key: s + NOISE[key] * rng.standard_normal(clean.n) for key, s in clean.signals.items()}
    return Record(signals, clean.fs, clean.name)


@pytest.mark.slow
def test_the_pull_of_noise_is_what_many_records_show() -> None:
    truth = MODEL.parameter_sets["table_1"]
    base = MODEL.base_from_physical(truth)
    clean = [
        simulate(MODEL, truth, kind, fs=5000.0, duration_s=4.0, oversample=n).record
        for kind, n in (("chirp", 32), ("trapezoid", 8))
    ]
    errors, said = [], []
    for seed in range(10):
        records = tuple(noisy(record, 10 * seed + k) for k, record in enumerate(clean))
        choice = choose_filter(MODEL, records, cutoff_hz=400.0)
        fit = METHODS["wls"].run(Job(MODEL, records, choice))[1]
        errors.append(100.0 * (fit.solution.x / base - 1.0))
        said.append(100.0 * noise_bias(MODEL, records, choice, fit) / base)
    # J_c +2.7 %, F_vmc +1.8 %, K +6.9 %, many standard errors each
    standard_error = np.std(errors, axis=0) / np.sqrt(10.0)
    bias = np.mean(errors, axis=0)
    assert bias[-1] > 20.0 * standard_error[-1]
    np.testing.assert_allclose(np.mean(said, axis=0), bias, atol=5.0 * float(standard_error.max()))
    np.testing.assert_allclose(np.mean(said, axis=0)[3:], bias[3:], rtol=0.15)


def slow(noise: float) -> Record:
    """So slow that the noise of a differentiated encoder can drown the acceleration."""
    return rigid_record(swings((0.02, 0.05), (0.01, 0.11)), n=40000, noise=noise)


def test_what_noise_pulls_is_named_and_in_the_interval() -> None:
    options = {"cutoff_hz": 10.0, "direction_cutoff_hz": 5.0}
    quiet, loud = (identify(RIGID, slow(noise), **values_of("wls", **options)) for noise in (1e-7, 5e-6))
    assert "biased by noise" not in kinds(quiet)
    (advice,) = [one for one in loud.checks.advice if one.kind == "biased by noise"]
    assert advice.where.startswith("M by -")
    low, high = loud.conf_int()["M"]
    assert low < TRUTH["M"] < high
    # instruments are not pulled
    instruments = identify(RIGID, slow(5e-6), **values_of("iv", delays="none", **options))
    assert "biased by noise" not in kinds(instruments)


def test_what_is_lost_in_noise_gets_no_number() -> None:
    estimate = identify(RIGID, slow(6e-5), **values_of("wls", cutoff_hz=10.0, direction_cutoff_hz=5.0))
    assert "M" not in estimate.params
    assert "noise of the sensors biases it by" in estimate.not_identifiable["M"]
    kept = identify(
        RIGID, slow(6e-5), **values_of("wls", cutoff_hz=10.0, direction_cutoff_hz=5.0, keep=("M",))
    )
    assert kept.params["M"] < 0.6 * TRUTH["M"]


def test_a_value_of_zero_is_not_lost_by_a_bias_that_its_interval_hardly_feels() -> None:
    fit = METHODS["wls"].run(Job(RIGID, (rigid_record(),), CHOICE))[1]
    std = np.sqrt(np.diag(hac_covariance(fit)))
    none = replace(fit, solution=replace(fit.solution, x=0.1 * std))
    assert lost_in_noise(none, 0.3 * std, 0.3 * std) == {}
    assert lost_in_noise(none, 2.0 * std, 0.2 * std) == {}
    assert set(lost_in_noise(none, 2.0 * std, 2.0 * std)) == set(fit.columns)


@pytest.mark.parametrize("which", ["emps", "bench"])
def test_good_sensors_pull_nothing(shared_data: Path, which: str) -> None:
    model, record = {"emps": emps, "bench": bench}[which](shared_data)
    choice = choose_filter(model, [record])
    fit = METHODS["wls"].run(Job(model, (record,), choice))[1]
    assert np.all(np.abs(noise_bias(model, [record], choice, fit)) < 1e-4 * np.abs(fit.solution.x))


def test_columns_that_are_nothing_but_noise_are_told() -> None:
    drowned = rigid_record(swings((0.02, 0.05), (0.01, 0.11)), n=40000, noise=3e-3)
    estimate = identify(RIGID, drowned, **values_of("wls", cutoff_hz=10.0, direction_cutoff_hz=5.0))
    assert "M" not in estimate.params
    assert all(np.isfinite(entry.std) for entry in estimate.parameters.identified)


@dataclass(frozen=True)
class Solved:
    """What the pull of noise is worked out from."""

    x: np.ndarray
    inverse: np.ndarray


@given(seed=st.integers(0, 10**6), share=st.floats(0.0, 1.2))
@settings(max_examples=40)
def test_one_direction_of_noise_pulls_what_has_a_part_in_it_and_nothing_else(seed: int, share: float) -> None:
    """Noise in one combination of columns: attenuated by its share, lost where it is alone."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((50, 4)) * 10.0 ** rng.uniform(-6.0, 6.0, 4)
    gram, x = W.T @ W, rng.uniform(0.5, 2.0, 4) / np.linalg.norm(W, axis=0)
    direction = np.linalg.solve(gram, np.r_[1.0, 0.7, 0.0, 0.0] * np.linalg.norm(W, axis=0))
    weight = gram @ direction
    added = share * np.outer(weight, weight) / (direction @ weight)
    fit = SimpleNamespace(solution=Solved(x, np.linalg.inv(gram)))
    effect = _without_noise(fit, added, np.zeros(4))  # type: ignore[arg-type]
    found = effect.bias
    assert effect.most == pytest.approx(share, abs=1e-6)
    if share < 0.89:
        wanted = np.linalg.inv(gram - added)
        np.testing.assert_allclose(effect.inverse, wanted, atol=1e-6 * np.abs(wanted).max())
    unit = direction / np.sqrt(direction @ weight)
    part = unit**2 / np.diag(fit.solution.inverse)
    if share > 0.91:
        np.testing.assert_array_equal(np.isinf(found), part > 0.01)
    elif share < 0.89:
        expected = x - unit * (unit @ gram @ x) / (1.0 - share) - (x - unit * (unit @ gram @ x))
        np.testing.assert_allclose(
            (found - expected) / x, 0.0, atol=1e-6 * (1.0 + np.max(np.abs(expected / x)))
        )
        # twice applied it is what takes the bias off
        left = effect.spread @ effect.spread @ x
        np.testing.assert_allclose((x - found - left) / x, 0.0, atol=1e-6 * (1.0 + np.max(np.abs(left / x))))


@pytest.mark.parametrize(("drowned", "moves"), [(5.0, False), (500.0, True)])
def test_products_of_noise_lose_a_direction_earlier_and_what_moves_with_it(
    drowned: float, moves: bool
) -> None:
    # the first column is a twentieth of the second: nothing of its variance, but much of its error
    gram = np.array([[1.0, 0.05], [0.05, 1.0]])
    fit = SimpleNamespace(solution=Solved(np.array([10.0, drowned]), np.linalg.inv(gram)))
    noise = np.diag([0.0, 0.85 / np.linalg.inv(gram)[1, 1]])
    linear = _without_noise(fit, noise, np.zeros(2))  # type: ignore[arg-type]
    assert linear.most == pytest.approx(0.85) and np.all(np.isfinite(linear.bias))
    products = _without_noise(fit, noise, np.zeros(2), noise)  # type: ignore[arg-type]
    np.testing.assert_array_equal(np.isinf(products.bias), [moves, True])
