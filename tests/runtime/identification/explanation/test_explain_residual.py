from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.identification.explanation.explain_residual import (
    timing_moves,
    unknown_timing,
    with_timing,
)
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.explanation.folded_forces import forces_bend
from modelgen.runtime.identification.explanation.look_at_residual import Seen
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_iv
from modelgen.runtime.iv.effect import DIRECTION, Effect
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import direction_channel
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import SMALL
from tests.runtime.two_mass_records import TRUTH as TWO_MASSES

RIGID = model_from_module(emps_rigid_qm)
QUIET = {"q_m": 1e-7, "q_c": 1e-7, "Gamma_m": 1e-6}
TRUTH = RIGID.parameter_sets["published_2019"]


def moving(kind: str, channel: str, move: float) -> Score:
    effect = Effect(f"{kind} of {channel}", kind, "late", "early", "", lambda _: {}, channel)
    return Score(effect, 1.0, np.nan, 0.01, np.array([move, 0.0]), 1.0, 1.0, np.nan, False)


def job(*records: Record) -> Job:
    choice = FilterChoice(4, 40.0, 20.0, (5,) * len(records), 20.0, None, (), (), ())
    return Job(RIGID, records, choice, late=("F",))


def test_delays_and_directions_that_were_to_be_found_move_the_estimate_certain_or_not() -> None:
    found = moving("delay", "F", 3.0), moving(DIRECTION, "m", 4.0), moving("delay", "q_m", 9.0)
    assert unknown_timing(job(), Seen(found)).tolist() == [[25.0, 0.0], [0.0, 0.0]]
    assert unknown_timing(job(), Seen(found, folded=np.eye(2))).tolist() == [[26.0, 0.0], [0.0, 1.0]]
    known = replace(job(), late=())
    assert unknown_timing(known, Seen(found)).tolist() == [[16.0, 0.0], [0.0, 0.0]]
    assert not np.any(unknown_timing(known, Seen(found[:1] + found[2:])))


def test_a_simulated_direction_is_known_to_a_part_of_a_sample() -> None:
    plain = Record({"q_m": np.zeros(9), "F": np.zeros(9)}, 1000.0, "axis")
    given = plain.edited({direction_channel("m"): np.ones(9)})
    small = (replace(moving(DIRECTION, "m", 4.0), size=1e-6),)
    assert unknown_timing(job(plain), Seen(small))[0, 0] == pytest.approx(16.0)
    assert unknown_timing(job(given), Seen(small))[0, 0] == pytest.approx(16.0 * 20.0**2)  # 20 us, not 1


@pytest.mark.parametrize("late_s", [0.0, 1e-3])
def test_a_late_force_is_in_the_intervals_of_least_squares(late_s: float) -> None:
    record = simulate(RIGID, TRUTH, "trapezoid", fs=1000.0, duration_s=4.0).record
    force = np.roll(record.signals["F"], round(late_s * record.fs))
    here = job(Record({"q_m": record.signals["q_m"], "F": force}, record.fs, "axis"))
    observation = here.observed(here.records)
    fit = fit_matched(observation)
    error = np.abs(fit.solution.x - [TRUTH[name] for name in fit.columns])
    moved = np.sqrt(np.diag(timing_moves(here, observation, fit)))
    # friction takes the late force's part at turns
    place = fit.columns.index("Fv")
    if late_s:
        assert moved[place] == pytest.approx(error[place], rel=0.3)
    else:
        assert moved[place] < 1e-3 * TRUTH["Fv"]


@pytest.mark.parametrize("motion", ["trapezoid", "chirp"])
def test_what_a_force_folds_is_in_the_intervals_of_instruments(motion: str) -> None:
    record = simulate(SMALL, TWO_MASSES, motion, fs=2000.0, duration_s=2.0, noise=QUIET, seed=5).record
    choice = choose_filter(SMALL, [record], cutoff_hz=150.0)
    here = Job(SMALL, (record,), choice)
    observation, fit = run_iv(here)
    found = Explained(observation, fit, (), (), np.zeros((len(fit.columns),) * 2), ())
    told = with_timing(here, found)
    share = np.sqrt(np.diag(told.drift)) / np.abs(fit.solution.x)
    if forces_bend(SMALL, [record]):
        assert motion == "trapezoid"
        assert 1e-6 < share[fit.columns.index("J_m")] < 0.05
    else:
        assert motion == "chirp"
        assert told is found
