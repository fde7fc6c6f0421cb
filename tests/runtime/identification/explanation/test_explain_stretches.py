"""What stretches of long records show is estimated on the whole of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.explanation.explain_residual import found_by, timing_moves
from modelgen.runtime.identification.explanation.explained import Begun, Explained
from modelgen.runtime.identification.explanation.look_at_residual import look
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import WLS, Auto
from modelgen.runtime.identification.task import Task
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records import record_facts
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import NOISE, SMALL, TRUTH, assert_truth_inside, two_mass_records

RIGID = model_from_module(emps_rigid_qm)


@pytest.fixture(autouse=True)
def stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explain_stretches, "SEARCHED", 8192)
    monkeypatch.setattr(explain_stretches, "STRETCHES", 2)


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "word"), [(0.25, "late"), (-0.5, "early")])
def test_an_encoder_out_of_step_is_found_in_stretches(samples: float, word: str) -> None:
    estimate = identify(SMALL, two_mass_records(late={"q_c": samples}))
    said = " ".join(one.sentence for one in estimate.checks.advice)
    assert f"q_c is {word} by" in said
    assert_truth_inside(estimate, TRUTH)


@pytest.mark.slow
def test_a_zero_of_a_stretch_is_its_records() -> None:
    zeros = [zero_effect("q_c", index, 4) for index in (2, 3)]
    (found,) = explain_stretches._of_records(tuple(zeros), [0, 0, 1, 1], 2)
    assert found.name == zero_effect("q_c", 1, 2).name
    estimate = identify(SMALL, two_mass_records(zeros={"q_c": 1e-3}))
    assert "record 3" not in " ".join(one.sentence for one in estimate.checks.advice)
    assert_truth_inside(estimate, TRUTH)


@pytest.mark.slow
def test_of_a_right_model_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []
    of_chain = default_method._of_chain

    def spied(task: Task, method: Auto) -> Begun:
        tried.extend(one.n for one in task.job.records)
        return of_chain(task, method)

    monkeypatch.setattr(default_method, "_of_chain", spied)
    estimate = identify(SMALL, two_mass_records())
    assert tried == [4096] * 4
    whole = identify(SMALL, two_mass_records(), "iv")
    assert [one.used for one in estimate.fit.rows] == [one.used for one in whole.fit.rows]
    assert not estimate.checks.advice
    assert_truth_inside(estimate, TRUTH)


def test_stretches_lie_where_a_very_long_record_is_active(monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(60_000) / 1000.0
    moving = np.where((t > 40.0) & (t < 50.0), np.sin(9.0 * t), 0.0)
    record = Record({"q_m": moving, "F": 3.0 * moving}, 1000.0, "log")
    assert [one.n for one in explain_stretches._stretches(record)] == [4096, 4096]
    assert [one.name for one in explain_stretches._stretches(record)] == [
        "log from sample 12952", "log from sample 42952"
    ]  # fmt: skip
    monkeypatch.setattr(record_facts, "WHOLE", 16_384)
    active = explain_stretches._stretches(Record(record.signals, 1000.0, "log"))
    assert len(active) * active[0].n == 8192
    # the first and the last of them lie where it begins and ends
    assert sum(np.ptp(one.signals["q_m"]) > 1.9 for one in active) == len(active) - 2


@pytest.mark.slow
def test_a_command_that_stretches_show_to_be_held_is_so_in_all_of_its_record(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(explain_stretches, "SEARCHED", 4096)
    drive, options = Drive(rate_hz=2000.0), {"fs": 2000.0, "duration_s": 3.0}
    record = simulate(SMALL, TRUTH, "chirp", drive=drive, noise=NOISE, seed=3, **options).record
    estimate = identify(SMALL, record)
    assert "held over every sample" in " ".join(one.sentence for one in estimate.checks.advice)
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] - TRUTH[name]) < 3.0 * estimate.bse[name]
        assert estimate.bse[name] < 2e-3 * TRUTH[name]


@pytest.mark.slow
def test_what_a_late_force_moves_is_seen_in_stretches_as_in_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truth = RIGID.parameter_sets["published_2019"]
    record = simulate(RIGID, truth, "trapezoid", fs=1000.0, duration_s=12.0).record
    late = Record({"q_m": record.signals["q_m"], "F": np.roll(record.signals["F"], 1)}, record.fs, "axis")
    job = Job(RIGID, (late,), FilterChoice(4, 40.0, 20.0, (5,), 20.0, None, (), (), ()), late=("F",))
    observation = job.observed(job.records)
    found = Explained(observation, fit_matched(observation), (), (), np.zeros((1, 1)), ())
    whole = timing_moves(job, observation, found.fit)
    seen: list[list[int]] = []

    def spied(job: Job, *given: object) -> np.ndarray:
        seen.append([one.n for one in job.records])
        return timing_moves(job, *given)

    monkeypatch.setattr(explain_stretches, "timing_moves", spied)
    short = explain_stretches.timing_by_stretches(job, WLS(), found)
    assert seen == [[4096, 4096]]
    # an offset hardly moves
    told = [found.fit.columns.index(name) for name in ("M", "Fv", "Fc")]
    assert np.diag(short)[told] ** 0.5 == pytest.approx(np.diag(whole)[told] ** 0.5, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("width", [0, 4])
def test_what_stretches_find_likely_all_samples_keep_or_drop(
    width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the encoder of the load as it is, or averaged over a sample, which acts as a lag
    asked: list[tuple[Job, Explained]] = []
    monkeypatch.setattr(
        explain_stretches, "_with_effects", lambda task, plain, *_: asked.append((task.job, plain)) or plain
    )
    identify(SMALL, two_mass_records(averaged={"q_c": width}))
    job, plain = asked[0]
    seen = look(job, found_by(job, plain.observation, plain.fit), (), None, ("lag",))
    (known,) = [one for one in seen.found if one.effect.name == "bandwidth of q_c"]
    assert known.likely == bool(width)
    held = replace(known, move=10.0 * known.move, likely=True)
    added = explain_stretches._known_better(job, plain, held)
    left = np.outer(held.move, held.move) + added
    assert np.allclose(
        left, bool(width) * np.outer(known.move, known.move), rtol=1e-9, atol=1e-12 * left.max()
    )
    assert not np.any(explain_stretches._known_better(job, plain, None))
