"""Cut-offs are predicted before the fit: higher where that tells more, lower where noise drowns it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification.cutoffs import choose_cutoff
from modelgen.runtime.identification.cutoffs.choose_cutoff import Scan, with_predicted_cutoff
from modelgen.runtime.identification.cutoffs.cutoff_steps import lacks_samples, with_enough_samples
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, Auto, run_iv
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import Task, prepared
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.masks import direction_keys
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.swinging_servo import SERVO
from tests.runtime.iv.physical.swinging_servo import TRUTH as SERVO_TRUTH
from tests.runtime.iv.physical.test_composite_iv import model_of as chain_of
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of
from tests.runtime.two_mass_records import SMALL

# a mode of 20 Hz, far above what moves between rests have most of their power at
SLOW_DRIVE = {"J_m": 1e-3, "F_vm": 5e-3, "F_sm": 0.02, "J_c": 1e-3, "F_vmc": 4e-3, "K": 8.0}


@cache
def chain_task(kind: str, noise: float, **filters: float) -> Task:
    rms = {"q_m": noise, "q_c": noise, "Gamma_m": 2e-3}
    record = simulate(SMALL, SLOW_DRIVE, kind, fs=1000.0, duration_s=4.0, noise=rms).record
    return prepared(SMALL, record, Auto(), Filters(**filters), CheckOptions())


@cache
def arm_task(**filters: float) -> Task:
    model = model_of(catalogued("two_link"))
    record = record_of(model, values_of(model), 10.0, noise=(2e-5, 0.1))
    return prepared(model, record, IV(), Filters(**filters), CheckOptions())


@cache
def predicted(consistent: bool, kind: str = "", noise: float = 0.0) -> Task:
    return with_predicted_cutoff(chain_task(kind, noise) if kind else arm_task(), consistent)


def scan_of(task: Task, consistent: bool) -> Scan:
    return Scan(task, consistent, task.job.records)


def instruments(task: Task) -> Fit:
    return run_iv(replace(task.job, late=()))[1]


def least_kept(found: Task) -> float:
    """Share of the record that the row that keeps least keeps; 0 where one does not leave turns out."""
    every = found.records[0].n / found.choice.decimation[0]
    blocks = found.job.calm(found.records).blocks
    return min(0.0 if block.turning else block.count / every for block in blocks)


def test_moves_between_rests_are_told_by_the_little_power_about_the_mode() -> None:
    first, better = chain_task("trapezoid", 1e-4), predicted(True, "trapezoid", 1e-4)
    assert first.choice.cutoff_hz < 15.0 < 25.0 < better.choice.cutoff_hz
    with pytest.raises(IdentifiabilityError):
        instruments(first)
    fit = instruments(better)
    truth = np.array([SLOW_DRIVE[name] for name in fit.columns])
    spread = np.sqrt(np.diag(hac_covariance(fit)))
    assert np.all(np.abs(fit.solution.x - truth) < 4.0 * spread)
    assert dict(zip(fit.columns, spread / truth, strict=True))["J_c"] < 0.02


def test_the_job_filters_as_the_task_says_and_a_sentence_says_why() -> None:
    better = predicted(True, "trapezoid", 1e-4)
    assert better.job.choice is better.choice
    assert [one for one in better.choice.sentences if one.startswith("Cut-off")] == [
        f"Cut-off {better.choice.cutoff_hz:.4g} Hz in place of "
        f"{chain_task('trapezoid', 1e-4).choice.cutoff_hz:.4g} Hz: least squares, tried at 6 cut-offs, "
        "predicts that most is known there."
    ]
    assert better.choice.bands


def test_a_chirp_keeps_its_cut_off() -> None:
    assert predicted(True, "chirp", 1e-4) is chain_task("chirp", 1e-4)


@pytest.mark.parametrize("consistent", [True, False])
def test_noise_is_told_from_what_a_higher_cut_off_would_tell(consistent: bool) -> None:
    quiet, loud = (scan_of(chain_task("chirp", noise), consistent) for noise in (1e-4, 1e-2))
    for scan in (quiet, loud):
        scan.best()
    assert quiet.worth()[0] > loud.worth()[0] + 6.0
    assert loud.worth()[-2] < loud.worth()[0]
    assert min(quiet.worth()) == 0  # lower ones are not tried where there is little noise
    assert min(loud.worth()) < 0


@pytest.mark.parametrize("kind", ["chain", "arm"])
def test_a_cut_off_that_was_given_stays(kind: str) -> None:
    given = chain_task("trapezoid", 1e-4, cutoff_hz=5.0) if kind == "chain" else arm_task(cutoff_hz=5.0)
    assert with_predicted_cutoff(given, True) is given


def test_turns_are_left_out_and_most_of_every_row_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    assert least_kept(arm_task()) < choose_cutoff.LEAST_CALM <= least_kept(predicted(True))
    monkeypatch.setattr(choose_cutoff, "LEAST_CALM", 1.0)
    assert with_predicted_cutoff(arm_task(), True) is arm_task()


def test_directions_of_joints_follow_their_motion_however_low_the_cut_off_is() -> None:
    first, scan = arm_task().choice, scan_of(arm_task(), consistent=False)
    lower, higher = scan.at(-2), scan.at(2)
    assert lower is not None and higher is not None
    assert lower.choice.cutoff_hz == pytest.approx(0.5 * first.cutoff_hz)
    assert lower.choice.direction_cutoff_hz == first.direction_cutoff_hz
    told = f"Directions of motion are the signs of velocities below {first.direction_cutoff_hz:.4g} Hz."
    assert told in lower.choice.sentences
    assert higher.choice.direction_cutoff_hz == first.direction_cutoff_hz > higher.choice.cutoff_hz


def test_least_squares_of_an_arm_keep_turns_and_need_no_higher_cut_off() -> None:
    assert predicted(False).choice.cutoff_hz < 0.6 * predicted(True).choice.cutoff_hz


@pytest.mark.parametrize("load", ["", pytest.param(', coulomb = "F_sl"', marks=pytest.mark.slow)])
def test_a_cutoff_far_below_the_band_of_a_random_force_is_found(load: str) -> None:
    """Between both noise drowns everything; a guessed direction of the load's friction is no hindrance."""
    speed = SERVO.replace('measures = "position"', 'measures = "velocity"')
    model = chain_of(speed.replace('inertia = "J_l"', f'inertia = "J_l"{load}'), "motor")
    truth = SERVO_TRUTH | ({"F_sl": 0.02} if load else {})
    fs, n = 4000.0, 24_000
    t, rng = np.arange(n) / fs, np.random.default_rng(1)
    back = np.where(t < 3.5, 1.0, np.maximum(1.0 - (t - 3.5) / 0.3, -1.0))
    rate = 8.0 * np.minimum(t / 0.4, 1.0) * back
    binary = 0.6 * np.repeat(rng.choice([-1.0, 1.0], n // 8), 8)
    moved = simulate(model, truth, Excitation(np.cumsum(rate) / fs, rate, binary, fs, "binary"), fs=fs).record
    rms = {"q_m": 0.02, "T": 1e-3}
    noisy = {key: moved.signals[key] + level * rng.standard_normal(n) for key, level in rms.items()}
    found = identify(model, Record(noisy, fs, "binary"))
    told = {entry.name: entry for entry in found.parameters.physical}
    for name in ("J_m", "J_l", "K", "D"):
        error = told[name].value - truth[name]
        assert abs(error) < 3.0 * told[name].std < 0.02 * truth[name]


def test_a_spring_of_no_stiffness_has_no_composites() -> None:
    model = chain_of(SERVO, "motor")
    assert any("/K" in one.replace(" ", "") for one in model.composites.values())
    with pytest.raises(IdentifiabilityError, match="has no rows where K is zero"):
        model.base_from_physical({**SERVO_TRUTH, "K": 0.0})


ONE = """
[chain]
name = "roll"
motion = "rotation"
[[bodies]]
name = "c"
inertia = "J_c"
viscous = "F_vc"
coulomb = "F_sc"
actuator = "tau_c"
[sensors.tachometer]
w_c = { body = "c", measures = "velocity" }
"""


@cache
def jog() -> tuple[Task, dict[str, float]]:
    """Three moves of 0.4 s between rests of 0.8 s, of a body with a tachometer."""
    truth, fs = {"J_c": 2e-3, "F_vc": 2e-3, "F_sc": 0.3}, 1000.0
    time, noise = np.arange(3600) / fs, np.random.default_rng(5)
    turn = np.where(time % 1.2 < 0.4, np.sin(2.0 * np.pi * 2.5 * (time % 1.2) - 0.5 * np.pi) + 1.0, 0.0)
    speed = 40.0 * turn * np.array([1.0, -1.0, 1.0])[(time / 1.2).astype(int)]
    force = (
        truth["J_c"] * np.gradient(speed, 1.0 / fs) + truth["F_vc"] * speed + truth["F_sc"] * np.sign(speed)
    )
    signals = {
        "w_c": speed + 0.1 * noise.standard_normal(len(time)),
        "tau_c": force + 2e-3 * noise.standard_normal(len(time)),
    }
    model = chain_of(ONE, "tachometer")
    return prepared(model, Record(signals, fs, "jog"), Auto(), Filters(), CheckOptions()), truth


def test_a_jog_between_rests_is_filtered_so_that_samples_are_left_of_it() -> None:
    """Behind the low-pass for the motion itself rests are felt in all but a few samples of the moves."""
    task, truth = jog()
    assert lacks_samples(task.model, task.job.calm(task.records))
    found = with_predicted_cutoff(task, consistent=True)
    assert not lacks_samples(task.model, found.job.calm(found.records))
    fit = instruments(found)
    spread = np.sqrt(np.diag(hac_covariance(fit)))
    expected = np.array([truth[name] for name in fit.columns])
    assert np.all(np.abs(fit.solution.x - expected) < 4.0 * spread)
    assert np.all(spread < 0.1 * expected)


def test_records_are_not_filtered_whole_where_a_part_leaves_samples_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task, lengths, observed = chain_task("chirp", 1e-4), [], Job.observed

    def counting(self: Job, records: tuple[Record, ...], **options: bool) -> Observation:
        lengths.append(records[0].n)
        return observed(self, records, **options)

    monkeypatch.setattr(Job, "observed", counting)
    (whole,) = task.job.records
    for n, asked in ((whole.n // 2, [whole.n // 2]), (60, [60, whole.n])):
        lengths.clear()
        assert with_enough_samples(task, (whole.part(0, n, "part"),)) is task
        assert lengths == asked


def test_two_frictions_in_a_row_are_told_apart_by_samples_that_feel_no_reversal() -> None:
    """One body and another: where few other samples are left, a row uses those that feel reversals."""
    text = (
        ONE
        + """
[[bodies]]
name = "a"
inertia = "J_a"
coulomb = "F_sa"
[[links]]
bodies = ["c", "a"]
stiffness = "K"
damping = "D"
"""
    )
    model = chain_of(text.replace("[sensors", '[sensors.both]\nw_c = { body = "c", measures = "velocity" }\n'
                     'q_a = { body = "a", measures = "position" }\n[sensors'), "both")  # fmt: skip
    turn = np.sin(2.0 * np.pi * 2.0 * np.arange(40000) / 1000.0)
    record = Record({"w_c": turn, "q_a": np.cumsum(turn) / 1000.0, "tau_c": turn**3}, 1000.0)
    rows = prepared(model, record, Auto(), Filters(), CheckOptions()).job.calm((record,))
    both = [block for block in rows.blocks if len(direction_keys(model, block.row)) > 1]
    assert both
    for turning in (False, True):
        blocks = tuple(replace(one, turning=turning) for one in both)
        assert lacks_samples(model, replace(rows, blocks=blocks)) == turning
