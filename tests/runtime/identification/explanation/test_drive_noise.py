"""Noise of a measured force pulls instruments that this force drives, as predicted, and is taken off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.identification.explanation import drive_noise, less_driven
from modelgen.runtime.identification.explanation.drive_noise import DriveBias, drive_bias
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, influence
from modelgen.runtime.records.record import Record
from tests.runtime.rigid_motion import RIGID, TRUTH, rigid_record, swings
from tests.runtime.two_mass_records import SMALL

MOTION = swings((0.02, 1.3), (0.004, 4.1), (0.0005, 23.0))


@pytest.mark.slow
def test_what_noise_of_a_force_moves_is_predicted_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    # an exact encoder, and as much noise in the force as a poor current sensor has
    quiet = rigid_record(MOTION, n=8_000)
    size = 0.2 * float(np.std(quiet.signals["F"]))
    record = rigid_record(MOTION, n=8_000, force_noise=size)
    estimate = identify(RIGID, record)
    assert estimate.bse["M"] < 0.01 * TRUTH["M"]
    assert all(abs(value - TRUTH[name]) < 3.0 * estimate.bse[name] for name, value in estimate.params.items())
    assert "noise of the forces biases instruments" in estimate.summary()

    predicted: dict[str, float] = {}

    def kept(job: Job, fit: Fit) -> DriveBias:
        bias = drive_bias(job, fit)
        predicted.update(zip(fit.columns, bias.shift.tolist(), strict=True))
        return bias

    monkeypatch.setattr(less_driven, "drive_bias", kept)
    iv = identify(RIGID, record, method="iv")
    driven = iv.params["M"] + predicted["M"] - estimate.params["M"]
    assert driven > 2.0 * estimate.bse["M"]
    assert 0.5 < driven / predicted["M"] < 2.0


@pytest.mark.slow
def test_where_encoders_are_noisy_as_well_it_is_taken_off_instruments() -> None:
    # of one motion: ten draws of the noise
    found = [
        identify(RIGID, rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6, seed=seed), method="iv")
        for seed in range(10)
    ]
    assert all("which is taken off" in one.summary() for one in found)
    off = np.array([one.params["M"] - TRUTH["M"] for one in found])
    assert abs(off.mean()) < 0.7 * found[0].bse["M"]
    assert np.sum(np.abs(off) < 2.0 * found[0].bse["M"]) >= 8


def test_where_it_is_not_known_well_intervals_hold_it(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    less = identify(RIGID, record, method="iv")
    monkeypatch.setattr(less_driven, "MOST_DRIVEN", 0.0)
    wider = identify(RIGID, record, method="iv")
    shift = wider.params["M"] - less.params["M"]
    assert shift > less.bse["M"]
    assert "the intervals are widened by that" in wider.summary()
    assert wider.bse["M"] == pytest.approx(np.hypot(less.bse["M"], shift), rel=0.1)


def test_the_default_leaves_what_hardly_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=0.5, noise=2e-5)
    plain = identify(RIGID, record)
    assert "noise of the forces" not in plain.summary()
    monkeypatch.setattr(less_driven, "drive_bias", _fails)
    assert identify(RIGID, record).params == plain.params


def _fails(*_: object) -> None:
    raise DataError.at("noise", "is too short", "give longer records")


def test_what_is_not_known_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    monkeypatch.setattr(less_driven, "drive_bias", _fails)
    assert "noise of the forces" not in identify(RIGID, record).summary()


def test_few_draws_say_what_many_say(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    shifts = []

    def kept(job: Job, fit: Fit) -> DriveBias:
        for few in (1, 4):
            monkeypatch.setattr(drive_noise, "DRAWS", 4 * few)
            shifts.append(drive_bias(job, fit))
        return shifts[0]

    monkeypatch.setattr(less_driven, "drive_bias", kept)
    identify(RIGID, record, method="iv")
    few, many = (one.shift for one in shifts[:2])
    assert few == pytest.approx(many, rel=0.1)
    assert 0.0 < shifts[0].share < 0.1


def loud_sines(n: int, fs: float = 5000.0) -> Record:
    """Sines of two bodies that solve their equations of motion, with noise, most of it of the force."""
    p, rng, t = SMALL.parameter_sets["table_2"], np.random.default_rng(0), np.arange(n) / fs
    motor, load, force = (np.zeros(n, dtype=complex) for _ in range(3))
    for f in (0.31, 1.7, 7.3, 23.0, 61.0, 109.0, 167.0):
        w = 2.0 * np.pi * f
        line = np.exp(1j * (w * t + rng.uniform(0.0, 6.0))) * (2.0 / (f + f**2 / 30.0))
        share = 1.0 - w**2 * p["J_c"] / (p["K"] + 1j * w * p["F_vmc"])
        load += line
        motor += share * line
        force += (share * (1j * w * p["F_vm"] - w**2 * p["J_m"]) - w**2 * p["J_c"]) * line
    friction = p["F_sm"] * np.sign(np.gradient(motor.imag))
    clean = {"q_m": motor.imag, "q_c": load.imag, "Gamma_m": force.imag + friction}
    noise = {"q_m": 1e-5, "q_c": 1e-5, "Gamma_m": 1e-3}
    return Record({k: s + noise[k] * rng.standard_normal(n) for k, s in clean.items()}, fs, "sines")


@pytest.fixture(scope="module")
def loud() -> tuple[Job, Fit]:
    """The job and the fit of two bodies whose force is noisy, its delay estimated with them, no row white."""
    asked = list[tuple[Job, Fit]]()

    def kept(job: Job, fit: Fit) -> DriveBias:
        asked.append((job, fit))
        return drive_bias(job, fit)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("modelgen.runtime.identification.job.MOST_WHITENED", 0)
        patch.setattr(less_driven, "drive_bias", kept)
        identify(SMALL, loud_sines(60_000), IV(delays="estimate"), cutoff_hz=680.0)
    return asked[0]


def test_a_delay_shifts_with_the_parameters(loud: tuple[Job, Fit]) -> None:
    job, fit = loud
    free = drive_bias(job, fit)
    assert fit.white is None and free.delays.shape == (1,)
    ((channel, late, _),) = fit.delays
    given = tuple(advanced(one, {channel: late - free.delays[0]}) for one in job.records)
    held = replace(job, records=given, late=(), start=replace(fit, delays=()))
    _, other = IV(delays="none").run(held)
    # with the delay where it belongs another shift comes out, and the same estimate without it
    fixed = drive_bias(held, other)
    deviations = np.sqrt(np.diag(hac_covariance(fit)))
    apart = (fit.solution.x - free.shift) - (other.solution.x - fixed.shift)
    assert np.all(np.abs(apart) < 0.4 * deviations)
    assert np.max(np.abs(fit.solution.x - other.solution.x) / deviations) > 0.5


def test_what_is_taken_off_widens_no_interval(loud: tuple[Job, Fit]) -> None:
    job, fit = loud
    found, _, told = less_driven.less_driven(job, IV(), fit)
    assert told
    psi = np.concatenate(influence(found))
    assert np.all(np.abs(psi.sum(axis=0)) < 1e-6 * np.abs(psi).sum(axis=0))
    assert np.allclose(hac_covariance(found), hac_covariance(fit), rtol=1e-9)


def test_beside_effects_that_are_simulated_it_stays_in_the_intervals(loud: tuple[Job, Fit]) -> None:
    job, fit = loud
    late = Effect("delay of q_c", "delay", "q_c is late", "q_c is early", "", lambda _: {})
    found, left, told = less_driven.less_driven(replace(job, effects=(late,)), IV(), fit)
    shift = drive_bias(job, fit).shift
    assert found is fit and "the intervals are widened" in told[0]
    assert np.allclose(left, np.outer(shift, shift))
    # a zero holds no noise
    found, _, _ = less_driven.less_driven(replace(job, effects=(zero_effect("q_c", 0, 1),)), IV(), fit)
    assert np.allclose(found.solution.x, fit.solution.x - shift)


def test_what_moves_the_machine_above_the_filter_is_not_taken_for_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # edges of a pseudorandom binary force fill the band from which the floor is read
    hz = np.random.default_rng(3).uniform(390.0, 499.0, 300)
    edges = [(1.5 / (TRUTH["M"] * 2.0 * np.pi * one), float(one)) for one in hz]
    busy = swings((0.02, 1.3), (0.004, 4.1), (0.0005, 23.0), *edges)
    record, white = rigid_record(busy, n=8_000, force_noise=0.5, noise=5e-7), 2.0 * 0.5**2 / 1000.0
    found = []

    def kept(job: Job, fit: Fit) -> DriveBias:
        bias = drive_bias(job, fit)
        share = float(drive_noise._passed(job, fit, 0)["F"])
        found.append((fit.solution.x[0], bias, share * record.facts.spectrum("F").noise))
        return bias

    monkeypatch.setattr(less_driven, "drive_bias", kept)
    moved = identify(RIGID, record, method="iv", cutoff_hz=40.0)
    x, bias, noise = found[0]
    assert record.facts.spectrum("F").noise > 3000.0 * white
    assert white < noise < 100.0 * white
    # a bound says that it is between nothing and all of that
    assert bias.at_most
    assert moved.params["M"] == pytest.approx(x - 0.5 * bias.shift[0], rel=1e-9)
    assert moved.bse["M"] > 0.5 * abs(bias.shift[0])
    assert abs(moved.params["M"] - TRUTH["M"]) < 3.0 * moved.bse["M"]


@pytest.mark.parametrize("hold", [(9, 11), (2, 4)])
def test_edges_that_few_samples_or_one_record_hold_are_no_noise(
    loud: tuple[Job, Fit], monkeypatch: pytest.MonkeyPatch, hold: tuple[int, int]
) -> None:
    """J_m was shifted by 2.5 % for the noise of a force that took a step in most of three samples."""
    # encoders are so coarse that rows tell nothing of the force's noise
    monkeypatch.setattr(drive_noise, "largest_density", lambda *_: np.inf)
    job, fit = loud
    record, rng = job.records[0], np.random.default_rng(1)
    own = record.facts.spectrum("Gamma_m").noise
    often = rng.choice([-0.1, -0.03, 0.03, 0.1], record.n)
    levels = np.repeat(often, rng.integers(*hold, record.n))[: record.n]
    edges, noise = record.edited({"Gamma_m": record.signals["Gamma_m"] + levels}), rng.normal(size=record.n)
    noisy = record.edited({"Gamma_m": record.signals["Gamma_m"] + 0.05 * noise})

    def taken_for_noise(*records: Record) -> float:
        share = drive_noise._passed(replace(job, records=records), fit, 0)["Gamma_m"]
        return float(share) * records[0].facts.spectrum("Gamma_m").noise

    assert edges.facts.spectrum("Gamma_m").noise > 20.0 * own
    assert taken_for_noise(edges) < 10.0 * own
    assert taken_for_noise(noisy, record) == pytest.approx(own, rel=0.1)
    # alone, or as noisy as the other one, it is noise
    assert taken_for_noise(noisy) == pytest.approx(2.0 * 0.05**2 / record.fs, rel=0.1)
    assert taken_for_noise(record, edges) == pytest.approx(own, rel=0.1)
