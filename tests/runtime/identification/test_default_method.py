"""The default method: what the model or its channels lack is found, and the truth stays in the intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.contradiction import contradiction
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV, Auto, Method
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.identification.task import Task
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime import measured_records
from tests.runtime.identification.test_assemble_estimate import TRUTH as NUMBERS
from tests.runtime.identification.test_assemble_estimate import observation
from tests.runtime.made_arm_records import catalogued, model_of
from tests.runtime.two_mass_records import (
    FS,
    GEARED,
    GEARED_TRUTH,
    SMALL,
    TRUTH,
    assert_truth_inside,
    curved,
    plain_estimate,
    two_mass_records,
)


def told(estimate: Estimate) -> list[tuple[str, str, str]]:
    """Kind, place and words of what an estimate advises."""
    return [(one.kind, one.where, one.what) for one in estimate.checks.advice]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_of_a_right_model_nothing_is_said(seed: int) -> None:
    estimate = identify(SMALL, two_mass_records(seed=seed))
    assert told(estimate) == []
    assert_truth_inside(estimate, TRUTH)
    assert estimate.fit.method == "iv"


def about_rest(seed: int) -> Record:
    """A chirp of the force about rest, from 0.15 to 1.8 times the resonance: hundreds of reversals."""
    rate_hz, duration_s = 16 * FS, 3.0
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    resonance = np.sqrt(TRUTH["K"] * (1.0 / TRUTH["J_m"] + 1.0 / TRUTH["J_c"]))
    phase = 0.15 * resonance * t + 0.5 * 1.65 * resonance * t**2 / duration_s
    zero, force = np.zeros_like(t), 6.0 * TRUTH["F_sm"] * np.sin(phase)
    excitation = Excitation(zero, zero, force, rate_hz, "rest")
    noise = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
    return simulate(SMALL, TRUTH, excitation, fs=FS, noise=noise, seed=seed).record


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("method", [Auto(), IV()], ids=["default", "iv"])
def test_a_chirp_about_rest_gives_no_delay_and_intervals_that_hold(method: Method, seed: int) -> None:
    estimate = identify(SMALL, [about_rest(seed)], method)
    assert estimate.delays == {}
    for name, value in estimate.params.items():
        assert abs(value - TRUTH[name]) < 3.0 * estimate.bse[name], name
    assert {"J_m", "J_c", "K"} <= set(estimate.params)
    assert estimate.bse["J_m"] < 0.05 * TRUTH["J_m"]
    # the default simulates directions, and finds none late any more; those of low-passed velocities may be
    if isinstance(method, Auto):
        assert any("directions near reversals are those" in note for note in estimate.fit.notes)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [7.0, -6.0, 25.0])
def test_a_force_late_by_whole_samples_is_found(samples: float) -> None:
    estimate = identify(SMALL, two_mass_records(late={"Gamma_m": samples}))
    assert abs(estimate.delays["Gamma_m"] - samples / FS) < 3.0 * estimate.delay_std["Gamma_m"]
    assert estimate.delay_std["Gamma_m"] < 0.01 / FS
    assert_truth_inside(estimate, TRUTH)
    assert told(estimate) == []


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "word"), [(-0.25, "early"), (0.25, "late"), (1.0, "late")])
def test_an_encoder_out_of_step_is_named_and_does_not_spoil_the_stiffness(samples: float, word: str) -> None:
    records = two_mass_records(late={"q_c": samples})
    estimate = identify(SMALL, records)
    found = [what for kind, _, what in told(estimate) if kind == "more than the model"]
    assert any(f"q_c is {word} by" in what for what in found)
    assert_truth_inside(estimate, TRUTH)
    # what is found is not bought with intervals that say nothing
    assert estimate.bse["K"] < 4.0 * plain_estimate().bse["K"]


def limited(records: list[Record], key: str, limit: float, beyond: float) -> list[Record]:
    """Return the records with a force read that acts by the share `beyond` only above a limit in its unit."""
    found = []
    for record in records:
        acting = record.signals[key]
        over = acting - np.clip(acting, -limit, limit)
        found.append(record.edited({key: acting + (1.0 / beyond - 1.0) * over}))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.7, 0.85])
def test_a_drive_that_saturates_is_named_and_does_not_spoil_the_inertia(share: float) -> None:
    right = two_mass_records()
    limit = share * max(float(np.max(np.abs(record.signals["Gamma_m"]))) for record in right)
    estimate = identify(SMALL, limited(right, "Gamma_m", limit, beyond=0.5))
    assert any("Gamma_m acts no further, or less, beyond" in what for _, _, what in told(estimate))
    assert_truth_inside(estimate, TRUTH)
    assert abs(estimate.params["J_m"] / TRUTH["J_m"] - 1.0) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "share", "words"),
    [
        ("dead zone", 0.2, "acts by a constant less than is recorded"),
        ("cube", 0.1, "falls with its size"),
        ("cube", -0.1, "rises with its size"),
    ],
)
def test_a_force_that_is_no_straight_line_is_named_and_spoils_no_friction(
    name: str, share: float, words: str
) -> None:
    estimate = identify(SMALL, curved(two_mass_records(), "Gamma_m", name, share))
    assert any(words in what for _, _, what in told(estimate))
    assert_truth_inside(estimate, TRUTH)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Coulomb friction on m", "the gain of Gamma_m"])
def test_what_changes_in_the_course_of_the_records_is_named_and_held(name: str) -> None:
    right, calm = two_mass_records(), two_mass_records(noise=0.0)
    rubs, share = (
        name.startswith("Coulomb"),
        {"Coulomb friction on m": 0.3, "the gain of Gamma_m": 0.05}[name],
    )
    every, start, changed = sum(record.n for record in right), 0, list[Record]()
    for record, still in zip(right, calm, strict=True):
        course = (start + np.arange(record.n)) / every - 0.5
        speed, force = np.gradient(still.signals["q_m"]), record.signals["Gamma_m"]
        moving = np.sign(speed) * (np.abs(speed) > 1e-3 * np.max(np.abs(speed)))
        more = -TRUTH["F_sm"] * moving if rubs else force  # as much less force as friction falls by
        changed.append(record.edited({"Gamma_m": force + share * course * more}))
        start += record.n
    estimate = identify(SMALL, changed)
    assert any(f"{name} falls in the course of the records" in what for _, _, what in told(estimate))
    assert_truth_inside(estimate, TRUTH)
    for name in ("F_sm",) if rubs else ("J_m", "J_c", "K"):
        assert estimate.bse[name] > 0.25 * share * TRUTH[name]  # a twelfth, and its root
    assert estimate.bse["K"] < 0.02 * TRUTH["K"]


@pytest.mark.slow
@pytest.mark.parametrize("zero", [1.0, -1.0])
def test_zeros_apart_do_not_spoil_the_stiffness(zero: float) -> None:
    estimate = identify(SMALL, two_mass_records(zeros={"q_c": zero}))
    assert any("q_c has a zero of its own" in what for _, _, what in told(estimate))
    assert_truth_inside(estimate, TRUTH)
    assert estimate.bse["K"] < 0.01 * TRUTH["K"]


@pytest.mark.slow
def test_zeros_apart_behind_a_gear_do_not_spoil_the_stiffness() -> None:
    estimate = identify(GEARED, two_mass_records(zeros={"q_c": 0.02}, geared=True))
    assert all("q_c has a zero of its own" in what for _, _, what in told(estimate))
    assert_truth_inside(estimate, GEARED_TRUTH, GEARED)
    assert estimate.bse["K"] < 0.01 * GEARED_TRUTH["K"]


def test_without_the_checks_no_effect_is_looked_for() -> None:
    records = two_mass_records(late={"q_c": 0.25})
    plain = identify(SMALL, records, checks=CheckOptions(drift_check=False))
    assert "more than the model" not in [kind for kind, _, _ in told(plain)]


def test_the_default_is_instruments_where_these_find_something() -> None:
    default, instruments = plain_estimate(), identify(SMALL, two_mass_records(), IV())
    assert default.params == instruments.params
    assert default.fit.method == instruments.fit.method == "iv"
    assert any(note.startswith("method iv") for note in default.fit.notes)


def without_instruments(task: Task, method: IV) -> Begun:
    raise IdentifiabilityError.at(method.name, f"nothing of {len(task.records)} records", "use wls")


def test_least_squares_stands_in_where_instruments_find_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(default_method, "_instrumental", without_instruments)
    estimate = identify(SMALL, two_mass_records(noise=0.01))
    assert estimate.fit.method == "wls"
    assert any("method wls" in note and "nothing of 2 records" in note for note in estimate.fit.notes)
    # next to no noise: what is left is the simulation's own error
    assert dict(estimate.params) == pytest.approx(dict(TRUTH), rel=1e-3)


def test_least_squares_does_not_stand_in_where_noise_pulls_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(default_method, "_instrumental", without_instruments)
    with pytest.raises(IdentifiabilityError, match="nothing of 2 records"):
        identify(SMALL, two_mass_records(noise=30.0), cutoff_hz=1000.0)


def test_what_a_method_hardly_determines_contradicts_nothing() -> None:
    rows = observation()
    rng = np.random.default_rng(5)
    noise = 1e-3 * np.std(rows.blocks[0].Y) * rng.standard_normal(rows.blocks[0].Y.shape)
    W = rows.blocks[0].W.copy()
    plain = fit_matched(replace(rows, blocks=(replace(rows.blocks[0], Y=W @ NUMBERS + noise),)))
    W[:, 4] = 0.3 * W[:, 3] + 0.2 * W[:, 2] + 1e-7 * W[:, 4]
    wild = fit_matched(replace(rows, blocks=(replace(rows.blocks[0], W=W, Y=W @ NUMBERS + noise),)))
    assert np.max(np.abs(wild.solution.x / plain.solution.x)) > 100.0
    assert not np.any(contradiction(plain, wild))
    spread = np.sqrt(np.diag(hac_covariance(plain)))
    moved = replace(plain.solution, x=plain.solution.x + np.array([0.0, 0.0, 9.0, 0.0, 0.0, 0.0]) * spread)
    assert np.flatnonzero(contradiction(plain, replace(plain, solution=moved))).tolist() == [2]


def test_both_of_its_kinds_have_its_options() -> None:
    default = Auto(delays={"Gamma_m": 1e-3}, held=("Gamma_m",), robust="huber", residual_dof="r-1")
    given = {"delays": {"Gamma_m": 1e-3}, "held": ("Gamma_m",), "robust": "huber", "residual_dof": "r-1"}
    assert default.instrumental == IV(**given)
    assert default.least_squares == replace(default.least_squares, **given)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "published"),
    [(1, {"J": 1.248, "F_v": 8.107, "F_s": 6.967}), (4, {"J": 0.0318, "F_v": 1.107, "F_s": 2.484})],
)
def test_axes_of_a_robot_hold_the_published_values(
    axis: int, published: dict[str, float], shared_data: Path
) -> None:
    model, record = measured_records.robot_axis(shared_data, axis)
    estimate = identify(model, record)
    for name, value in published.items():
        assert abs(estimate.params[name] - value) < 2.0 * estimate.bse[name], name
        assert estimate.bse[name] < 0.3 * value
    assert not {"clipped", "stuck"} & {kind for kind, _, _ in told(estimate)}


@pytest.mark.slow
def test_an_arm_whose_delays_do_not_come_to_rest_keeps_its_instruments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("modelgen.runtime.least_squares.delays.DELAY_ROUNDS", 1)
    model = model_of(catalogued("two_link"))
    values = model.parameter_sets["nominal"]
    noise = {"q_1": 2e-5, "q_2": 2e-5, "tau_1": 0.2, "tau_2": 0.05}
    record = simulate_arm(model, values, noise=noise, fs=500.0).record
    found = identify(model, record, checks=CheckOptions(tests=False))
    assert found.fit.method == "iv" and not found.delays
    assert "delays are not estimated (parameters and delays still move" in found.fit.notes[0]
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    z = np.array([(value - truth[name]) / found.bse[name] for name, value in found.params.items()])
    assert np.mean(np.abs(z) < 1.96) > 0.8
