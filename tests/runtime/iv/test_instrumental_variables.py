"""Instrumental variables: consistent where least squares is biased, with intervals that hold the truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.iv import instrumental_variables
from modelgen.runtime.iv.companion_simulation import Loop, run_beside
from modelgen.runtime.iv.instrumental_variables import (
    Setting,
    fit_iv,
    instruments,
    simulated,
    simulation_parameters,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.wls import fit_at, fit_matched
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import chirp
from modelgen.runtime.simulation.plant import possible
from modelgen.runtime.simulation.simulate import simulate

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
RECORDS = 16
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}


@cache
def clean(sensors: str, parameters: str) -> tuple[Record, ...]:
    model = {"qc": QC, "ac": AC}[sensors]
    truth = model.parameter_sets[parameters]
    kinds = (("chirp", 32), ("trapezoid", 8))
    return tuple(
        simulate(model, truth, kind, fs=5000.0, duration_s=2.0, oversample=n).record for kind, n in kinds
    )


def with_noise(record: Record, rng: np.random.Generator, factor: float = 1.0) -> Record:
    signals = {
        key: samples + factor * NOISE[key] * rng.standard_normal(record.n)
        for key, samples in record.signals.items()
    }
    return Record(signals, record.fs, record.name, record.tag)


@pytest.mark.parametrize(("sensors", "model"), [("qc", QC), ("ac", AC)])
def test_without_noise_the_truth_comes_out(sensors: str, model: Model) -> None:
    estimate = identify(model, clean(sensors, "table_2"), **values_of("iv", delays="none", drift_check=False))
    for name, value in model.parameter_sets["table_2"].items():
        assert estimate.params[name] == pytest.approx(value, rel=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("sensors", "model", "parameters"), [("qc", QC, "table_1"), ("ac", AC, "light")])
def test_bias_and_coverage(sensors: str, model: Model, parameters: str) -> None:
    """The short version of benchmarks/interval_coverage.py."""
    truth = np.array(list(model.parameter_sets[parameters].values()))
    values, spreads = [], []
    for seed in range(RECORDS):
        rng = np.random.default_rng(seed)
        records = [with_noise(record, rng) for record in clean(sensors, parameters)]
        estimate = identify(model, records, **values_of("iv", delays="none", drift_check=False))
        values.append([entry.value for entry in estimate.parameters.identified])
        spreads.append([entry.std for entry in estimate.parameters.identified])
    error = np.array(values) - truth
    bias = error.mean(axis=0) / error.std(axis=0, ddof=1)
    # 0.25 and three standard deviations of a mean
    assert np.all(np.abs(bias) < 0.25 + 3.0 / np.sqrt(RECORDS)), bias
    covered = np.mean(np.abs(error) < 1.96 * np.array(spreads), axis=0)
    # 0.9 and three standard deviations of a share
    assert np.all(covered > 0.9 - 3.0 * np.sqrt(0.9 * 0.1 / RECORDS)), covered
    # nor are the intervals padded
    assert np.all(np.median(spreads, axis=0) < 2.0 * error.std(axis=0, ddof=1))


@pytest.mark.slow
def test_noise_biases_least_squares_and_not_iv() -> None:
    truth = AC.parameter_sets["table_1"]["K"]
    errors = {}
    for method in ("wls", "iv"):
        rng = np.random.default_rng(0)
        found = []
        for _ in range(3):
            records = [with_noise(record, rng, 3.0) for record in clean("ac", "table_1")]
            estimate = identify(
                AC, records, **values_of(method, cutoff_hz=350.0, delays="none", drift_check=False)
            )
            found.append(estimate.params["K"])
        errors[method] = np.mean(found) / truth - 1.0
    assert abs(errors["wls"]) > 0.2
    assert abs(errors["iv"]) < 0.05


@pytest.mark.parametrize("parameters", ["table_1", "light"])
def test_with_noise_in_the_force_alone_the_force_still_fixes_the_scale(parameters: str) -> None:
    rng = np.random.default_rng(0)
    records = [
        Record(
            dict(record.signals) | {"Gamma_m": with_noise(record, rng).signals["Gamma_m"]},
            record.fs,
            record.name,
        )
        for record in clean("qc", parameters)
    ]
    estimate = identify(QC, records, **values_of("iv", drift_check=False))
    for entry in estimate.parameters.identified:
        assert abs(entry.value - QC.parameter_sets[parameters][entry.name]) < 3.5 * entry.std


def test_a_row_that_holds_nearly_exactly_weighs_what_it_leaves() -> None:
    """A floor of a thousandth of its terms had left three times the noise in it, behind a gear of 100."""
    rng = np.random.default_rng(5)
    noise = {"q_m": 4e-6, "q_c": 4e-6, "Gamma_m": 1e-4}
    records = [
        Record(
            {key: y + noise[key] * rng.standard_normal(record.n) for key, y in record.signals.items()},
            record.fs,
            record.name,
        )
        for record in clean("qc", "light")
    ]
    setting = Setting(QC, records, choose_filter(QC, records))
    fit = fit_iv(fit_matched(observe(QC, records, setting.choice, turns=False)), setting)
    exact = [at for at, block in enumerate(fit.blocks) if not block.has_force]
    assert max(fit.left_shares[at] for at in exact) < 9e-4
    for at, weight in enumerate(fit.weights):
        assert weight * fit.rms(at) == pytest.approx(1.0, rel=0.02)


def test_iv_and_its_projection_are_the_same_estimate() -> None:
    rng = np.random.default_rng(1)
    records = [with_noise(record, rng) for record in clean("qc", "table_2")]
    choice = choose_filter(QC, records)
    start = fit_matched(observe(QC, records, choice, turns=False))
    setting = Setting(QC, records, choice)
    runs = simulated(start, setting, simulation_parameters(QC, start))
    Z = instruments(start, setting, runs)
    fit = two_stage(start, Z)
    weight = np.concatenate([np.full(len(z), w) for w, z in zip(fit.weights, Z, strict=True)])[:, None]
    stacked = weight * np.concatenate(Z)
    W = weight * np.concatenate([block.W for block in fit.blocks])
    Y = weight[:, 0] * np.concatenate([block.Y for block in fit.blocks])
    scale = np.linalg.norm(W, axis=0)
    expected = np.linalg.solve(stacked.T @ W / np.outer(scale, scale), stacked.T @ Y / scale) / scale
    np.testing.assert_allclose(fit.solution.x, expected, rtol=1e-6)


def test_a_simulation_that_cannot_be_right_is_reported() -> None:
    records = clean("qc", "light")
    choice = choose_filter(QC, records)
    start = fit_matched(observe(QC, records, choice))
    still = tuple(Record({k: 0.0 * s for k, s in r.signals.items()}, r.fs, r.name) for r in records)
    with pytest.raises(IdentifiabilityError, match="method iv"):
        fit_iv(replace(start), Setting(QC, still, choice))


def test_a_run_beside_a_record_is_what_the_record_shows_without_noise() -> None:
    record = clean("qc", "light")[0]
    choice = choose_filter(QC, [record])
    run = run_beside(QC, QC.parameter_sets["light"], with_noise(record, np.random.default_rng(2)), choice)
    for key in ("q_m", "q_c"):
        moving = record.signals[key] - np.mean(record.signals[key])
        assert np.std(run.signals[key] - record.signals[key]) < 0.01 * np.std(moving)


def test_with_the_reference_and_the_controller_the_closed_loop_is_run() -> None:
    truth = QC.parameter_sets["light"]
    controller = PositionVelocityController(0.06, 1e-3)
    excitation = chirp(20.0, 150.0, 1.0, 5000.0, force=0.05, velocity=40.0, oversample=1)
    measured = simulate(QC, truth, excitation, controller=controller).record
    signals = dict(measured.signals) | {
        "reference": excitation.reference,
        "reference_rate": excitation.reference_rate,
        "feedforward": excitation.feedforward,
    }
    silent = Record({**signals, "Gamma_m": np.zeros(measured.n)}, 5000.0, "loop")
    choice = choose_filter(QC, [measured])
    run = run_beside(QC, truth, silent, choice, Loop(controller))
    for key in QC.channels:
        np.testing.assert_allclose(
            run.signals[key][2000:], measured.signals[key][2000:], atol=1e-6 * np.ptp(measured.signals[key])
        )


def test_what_cannot_be_simulated_is_moved_to_what_can() -> None:
    values = dict(QC.parameter_sets["light"]) | {"J_c": -1e-9, "F_vmc": -1.0, "F_sm": -0.1}
    moved = possible(QC, values)
    assert moved["J_c"] > 0.0
    assert (moved["F_vmc"], moved["F_sm"], moved["K"]) == (0.0, 0.0, values["K"])
    # an iteration may drive to zero what a record does not show
    assert possible(QC, values | {"F_vmc": 1e-40})["F_vmc"] == 0.0


def test_samples_near_a_reversal_are_left_out_unless_nothing_would_be_left() -> None:
    records = clean("qc", "light")
    choice = choose_filter(QC, records)
    whole = observe(QC, records, choice)
    thinned = observe(QC, records, choice, turns=False)
    masked = {(b.record_name, b.row_name): b.masked for b in thinned.blocks}
    before = {(b.record_name, b.row_name): b.masked for b in whole.blocks}
    assert masked["trapezoid", "m"] > before["trapezoid", "m"]
    assert masked["trapezoid", "c"] == before["trapezoid", "c"]
    t = np.arange(10000) / 5000.0
    swinging = Record(
        {"q_m": np.sin(300.0 * t), "q_c": np.sin(300.0 * t), "Gamma_m": np.cos(300.0 * t)}, 5000.0
    )
    choice = choose_filter(QC, [swinging], cutoff_hz=200.0)
    whole = observe(QC, [swinging], choice)
    kept = observe(QC, [swinging], choice, turns=False)
    assert [block.masked for block in kept.blocks] == [block.masked for block in whole.blocks]


def test_the_methods_share_their_rows() -> None:
    records = clean("qc", "light")
    job = Job(QC, records, choose_filter(QC, records))
    for name in ("wls", "iv"):
        observation, fit = METHODS[name].run(job)
        assert observation.columns == fit.columns == QC.base_parameters


def test_settings_nearby_share_one_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Instruments of the estimate serve at other cut-offs: there they move it by next to nothing."""
    runs = []

    def counted(*given: Any) -> Record:
        runs.append(given)
        return run_beside(*given)

    monkeypatch.setattr(instrumental_variables, "run_beside", counted)
    records = [with_noise(record, np.random.default_rng(3)) for record in clean("qc", "table_2")]
    choice = choose_filter(QC, records)

    def at(cutoff_hz: float, start: Fit | None) -> Fit:
        setting = Setting(QC, records, replace(choice, cutoff_hz=cutoff_hz))
        rows = observe(QC, records, setting.choice, turns=False)
        return fit_iv(fit_matched(rows) if start is None else fit_at(rows, start), setting)

    here = at(choice.cutoff_hz, None)
    runs.clear()
    shared = at(0.7 * choice.cutoff_hz, here)
    assert not runs
    own = at(0.7 * choice.cutoff_hz, None)
    assert runs
    spread = np.sqrt(np.diag(hac_covariance(own)))
    assert np.all(np.abs(shared.solution.x - own.solution.x) < 0.05 * spread)


def test_an_estimate_far_from_its_start_gets_instruments_of_its_own() -> None:
    records = [with_noise(record, np.random.default_rng(3)) for record in clean("qc", "table_2")]
    setting = Setting(QC, records, choose_filter(QC, records))
    rows = observe(QC, records, setting.choice, turns=False)
    own = fit_iv(fit_matched(rows), setting)
    far = replace(own, solution=replace(own.solution, x=3.0 * own.solution.x))
    runs = simulated(far, setting, simulation_parameters(QC, far))
    found = fit_iv(fit_at(rows, replace(far, simulated=runs)), setting)
    assert found.simulated is not runs
    spread = np.sqrt(np.diag(hac_covariance(own)))
    np.testing.assert_array_less(np.abs(found.solution.x - own.solution.x), 0.02 * spread)


@pytest.mark.parametrize(
    ("rounds", "move", "rests"), [(2, 0.5, True), (12, 5.0, False), (13, 5.0, True), (13, 50.0, False)]
)
def test_after_many_rounds_a_tenth_of_a_deviation_is_rest(rounds: int, move: float, rests: bool) -> None:
    # directions jump from sample to sample: rounds do not shrink moves for ever (here in hundredths)
    assert instrumental_variables._stands_still([move] * rounds) is rests
