"""Friction that the spec does not name is in the intervals where a late sensor hides it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation.hidden_friction import moved_by_hidden_friction
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.effect_rows import effect_rows, simulated_records
from modelgen.runtime.iv.freed_effects import Freed, fit_with_effects
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.score_tests import Span
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.identification.explanation.test_search import TRUTH, TWO
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.two_mass_records import FS, RAMPS, SMALL, two_mass_records

EFFECTS = {effect.name: effect for effect in effects_of(SMALL, ("m", "c"), RAMPS)}
LATE, FRICTION = EFFECTS["delay of q_c"], EFFECTS["viscous friction on c"]


@cache
def late() -> Freed:
    """An encoder that is half a sample late, with its delay estimated."""
    records = tuple(two_mass_records(late={"q_c": 0.5 / FS}))
    job = Job(SMALL, records, choose_filter(SMALL, records))
    return fit_with_effects(job.setting(), job.calm, METHODS["iv"].run(job)[1], (LATE,))


@pytest.mark.parametrize("known", [(), (LATE,)])
def test_friction_hidden_by_a_late_encoder_moves_damping_and_not_the_sum(known: tuple[Effect, ...]) -> None:
    freed = late()
    simulated = simulated_records(freed.fit, freed.setting, (LATE,), freed.sizes)
    (rows,) = effect_rows(freed.fit, freed.setting, simulated, (FRICTION,))
    span = Span(freed.fit, freed.others)
    moved = moved_by_hidden_friction(SMALL, span, simulated, known, {FRICTION: rows})
    place = {name: index for index, name in enumerate(freed.fit.columns)}
    assert moved[place["F_vm"], place["F_vm"]] == 0.0
    assert (moved[place["F_vmc"], place["F_vmc"]] > 0.0) == bool(known)
    # as far as it is open: the delay shows in accelerations
    friction = freed.fit.solution.x[place["F_vm"]]
    assert np.sqrt(moved[place["F_vmc"], place["F_vmc"]]) < 0.1 * friction


@pytest.mark.slow
def test_friction_of_the_load_is_told_from_the_delay_of_its_encoder_or_held() -> None:
    truth = {**TRUTH, "F_sl": 0.0, "F_vl": 0.008, "D": 0.02}
    noise, loaded = {"q_m": 2e-6, "q_l": 2e-6, "T": 2e-3}, model_of(TWO, "both")
    records = []
    for seed, motion in enumerate(("trapezoid", "chirp")):
        made = simulate(loaded, truth, motion, fs=4000.0, duration_s=2.0, noise=noise, seed=seed).record
        read = {key: samples[1:] for key, samples in made.signals.items()}
        read["q_l"] = made.signals["q_l"][:-1]
        records.append(Record(read, made.fs, motion))
    found = identify(model_of(TWO.replace(', viscous = "F_vl", coulomb = "F_sl"', ""), "both"), records)
    named = any("viscous friction" in one.what for one in found.checks.advice)
    truth["F_vm"] += 0.0 if named else truth["F_vl"]
    for one in found.parameters.physical:
        assert abs(one.value - truth[one.name]) < 4.0 * one.std, one.name
