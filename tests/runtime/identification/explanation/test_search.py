"""What goes from a search for effects once another one is estimated, and what stays."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation import search as module
from modelgen.runtime.identification.explanation.look_at_residual import Seen
from modelgen.runtime.identification.explanation.search import Search
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.two_mass_records import FS, RAMPS, SMALL, two_mass_records

TWO = """
chain = { name = "two", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "l", inertia = "J_l", viscous = "F_vl", coulomb = "F_sl" },
]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D" }]

[sensors.both]
q_m = { body = "m", measures = "position" }
q_l = { body = "l", measures = "position" }
"""
TRUTH = {
    "J_m": 2e-3, "F_vm": 0.02, "F_sm": 0.4, "J_l": 4e-3, "F_vl": 0.01, "F_sl": 0.15, "K": 1800.0, "D": 0.4,
}  # fmt: skip

Solved = tuple[tuple[Effect, ...], Freed]
EFFECTS = {effect.name: effect for effect in effects_of(SMALL, ("m", "c"), RAMPS)}
FRICTION, LATE, GAIN, OTHER, LAG = (
    EFFECTS[name]
    for name in (
        "Coulomb friction on c",
        "delay of q_c",
        "gain of q_c",
        "constant force on c",
        "lag of Gamma_m",
    )
)


@cache
def job() -> Job:
    records = tuple(two_mass_records())
    return Job(SMALL, records, choose_filter(SMALL, records))


def solved(monkeypatch: pytest.MonkeyPatch, certain: dict[str, float], late_s: float = 0.0) -> None:
    """Let every fit find sizes that are so many of their standard deviations, and forces late by so much."""
    left = SimpleNamespace(delays=(("Gamma_m", late_s, 1e-6),), unknown=())

    def fit(setting: Any, rows: Any, start: Any, effects: tuple[Effect, ...], *rest: Any) -> Solved:
        stds = tuple(1e-6 for _ in effects)
        sizes = tuple(certain[effect.name] * 1e-6 for effect in effects)
        return effects, Freed(cast(Any, None), cast(Any, left), setting, sizes, stds)

    monkeypatch.setattr(module, "fit_in_shape", fit)


def leaving(misfit: float, x: float = 0.0) -> SimpleNamespace:
    """Return a fit that leaves so much; which samples it uses makes no difference."""
    at = SimpleNamespace(x=np.full(6, x))
    return SimpleNamespace(
        misfit=misfit, blocks=(), delays=(), solution=at, simulated=None, carried=None, unknown=()
    )


def by_misfit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let fits without rows leave what they say they leave."""
    monkeypatch.setattr(module, "left_of_each", lambda job, found, moved: [fit.misfit for fit, *_ in found])


def searching(*effects: Effect, given: int = 0) -> Search:
    now = Freed(cast(Any, None), cast(Any, None), job().setting(), tuple(1e-6 for _ in effects))
    return Search(job(), None, now, effects, given, {}, np.zeros((6, 6)))


def test_what_stood_in_for_an_effect_goes_once_that_one_is_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    solved(monkeypatch, {LATE.name: 1.5, GAIN.name: -8.0, FRICTION.name: 20.0})
    found = searching(LATE, GAIN)._freed(FRICTION)
    assert found is not None
    assert found[0] == (GAIN, FRICTION)
    assert len(found[1].sizes) == 2


def test_where_no_motion_can_be_simulated_nothing_is_told() -> None:
    assert searching().told(Seen()) == []


def test_effects_that_a_start_brought_along_stay_however_small(monkeypatch: pytest.MonkeyPatch) -> None:
    solved(monkeypatch, {LATE.name: 0.1, FRICTION.name: 20.0})
    found = searching(LATE, given=1)._freed(FRICTION)
    assert found is not None
    assert found[0] == (LATE, FRICTION)


def test_an_effect_whose_sign_physics_forbids_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    solved(monkeypatch, {LATE.name: 5.0, FRICTION.name: -20.0})
    assert searching(LATE)._freed(FRICTION) is None


@pytest.mark.parametrize(("late", "taken"), [(0.0, False), (-0.8, True), (2.0, False)])
def test_a_force_that_acts_behind_a_lag_is_as_late_as_that(
    monkeypatch: pytest.MonkeyPatch, late: float, taken: bool
) -> None:
    size = -0.5e-6  # a time constant of a millisecond, `late` of which the force is recorded late
    solved(monkeypatch, {LAG.name: 1e6 * size}, late_s=1e-3 * late)
    assert (searching()._freed(LAG) is not None) == taken


@pytest.mark.parametrize(
    ("samples", "certain", "told"), [(0.01, 20.0, False), (0.1, 20.0, True), (0.1, 2.0, False)]
)
def test_a_delay_of_a_hundredth_of_a_sample_is_not_told(samples: float, certain: float, told: bool) -> None:
    search = searching(LATE)
    size = samples / FS
    search = replace(search, now=replace(search.now, sizes=(size,), stds=(size / certain,)))
    assert search.told(Seen()) == [told]


def test_a_delay_that_directions_near_reversals_make_is_not_told() -> None:
    search = searching(LATE)
    search = replace(search, job=replace(job(), late=(LATE.channel,)))
    for samples, told in ((0.15, False), (0.3, True)):
        now = replace(search.now, sizes=(samples / FS,), stds=(0.01 / FS,))
        assert replace(search, now=now).told(Seen()) == [told]


def test_what_encoders_are_too_coarse_for_is_not_told() -> None:
    search = searching(FRICTION)
    search = replace(search, now=replace(search.now, stds=(1e-8,)))
    assert search.told(Seen()) == [True]
    assert search.told(Seen(rounded=frozenset({FRICTION.name}))) == [False]


def test_what_is_told_is_certain_over_all_that_was_looked_for() -> None:
    search = searching(FRICTION)
    search = replace(search, now=replace(search.now, stds=(search.now.sizes[0] / 3.0,)))
    assert search.told(Seen()) == [True]
    assert search.told(Seen(tested=tuple(EFFECTS.values()))) == [False]


@pytest.mark.parametrize(("own", "held"), [(1e-3, 0.25), (0.5, 100.0)])
def test_what_is_nearly_a_column_is_held_as_a_fit_with_it_says(own: float, held: float) -> None:
    """A low-pass beside a further mass moved an inertia by 118 % along its tangent, solved again by 0.6 %."""
    fits = [cast(Any, leaving(misfit, x)) for misfit, x in ((-10.0, 1.0), (-5.0, 1.5))]
    now, other = (replace(searching(LAG).now, fit=fit, sizes=(2e-6,)) for fit in fits)
    far = Score(LAG, 1e-3, 1e-6, 0.1, np.full(6, 10.0), own, 1.0, 1e-6, matters=True)
    known = replace(searching(), now=now)
    score = known._as_solved(far, [(GAIN, (GAIN,), now), (LAG, (LAG,), other)])
    assert float(score.move[0]) ** 2 == held
    assert score.size / score.std == pytest.approx(far.size / far.std)
    assert known._as_solved(far, [(GAIN, (GAIN,), other)]) is far


@pytest.mark.parametrize("periods", [0.4, 0.6])
def test_a_fit_with_a_delay_of_half_a_period_says_nothing(periods: float) -> None:
    """An encoder of a periodic record came out 9.9 ms early at 120 Hz, and a stiffness was refused."""
    searched = searching()
    late = periods / job().choice.cutoff_hz
    other = replace(searching(LATE).now, fit=cast(Any, leaving(-5.0, 1.5)), sizes=(-late,))
    known = replace(searched, now=replace(searched.now, fit=cast(Any, leaving(-10.0, 1.0))))
    far = Score(LATE, 1e-4, 1e-6, 0.1, np.full(6, 10.0), 1e-3, 1.0, 1e-6, matters=True)
    score = known._as_solved(far, [(LATE, (LATE,), other)])
    assert (score is far) == (periods > 0.5)


def test_of_equals_a_delay_is_taken_before_a_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    by_misfit(monkeypatch)
    clock = EFFECTS["clock of q_c"]
    found = Freed(cast(Any, None), cast(Any, leaving(0.0)), job().setting(), (1e-6,), (1e-9,))
    start = replace(searching(), now=replace(found, sizes=()))
    for tried in ((clock, LATE), (LATE, clock)):
        after = start._with([(one, (one,), found) for one in tried])
        assert after.effects == (LATE,)
        assert [equal.effect for equal in after.ties[LATE.name]] == [clock]


def test_effects_that_take_each_other_s_place_do_not_do_so_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    by_misfit(monkeypatch)
    left = leaving(0.0)

    def fit(setting: Any, rows: Any, start: Any, effects: tuple[Effect, ...], *rest: Any) -> Solved:
        sizes = (*(1e-7 for _ in effects[1:]), 1e-4)  # only the last one is certain
        stds = tuple(1e-6 for _ in effects)
        return effects, Freed(cast(Any, None), cast(Any, left), setting, sizes, stds)

    monkeypatch.setattr(module, "fit_in_shape", fit)
    search = searching()
    search = replace(search, now=replace(search.now, fit=cast(Any, left)))
    turns, steps = (FRICTION, OTHER), 0
    while not search.ended:
        move = np.zeros(6)
        shown = Score(turns[steps % 2], 1e-4, 1e-6, 0.5, move, 1.0, 1.0, 1e-6, True)
        search, steps = search.step(Seen((shown,))), steps + 1
        assert steps < 6
    assert [one.kind for one in search.advice] == ["more than the model"]


@pytest.mark.parametrize(("misfit", "taken"), [(-900.0, False), (-1003.0, True)])
def test_what_leaves_more_than_what_is_estimated_is_not_taken_for_it(
    monkeypatch: pytest.MonkeyPatch, misfit: float, taken: bool
) -> None:
    def fit(setting: Any, rows: Any, start: Any, effects: tuple[Effect, ...], *rest: Any) -> Solved:
        sizes = (*(1e-7 for _ in effects[1:]), 1e-4)  # the first one goes
        left = cast(Any, leaving(misfit))
        return effects, Freed(cast(Any, None), left, setting, sizes, tuple(1e-6 for _ in effects))

    by_misfit(monkeypatch)
    monkeypatch.setattr(module, "fit_in_shape", fit)
    search = searching(FRICTION)
    search = replace(search, now=replace(search.now, fit=cast(Any, leaving(-1000.0))))
    moved = np.ones(6)
    found = search.step(Seen((Score(OTHER, 1e-4, 1e-6, 0.5, moved, 1.0, 1.0, 1e-6, True),)))
    assert found.effects == ((OTHER,) if taken else (FRICTION,))
    # what is not taken is in the intervals
    assert found.ended is not taken
    assert found.drift[0, 0] == (0.0 if taken else 1.0)


def test_a_gain_of_a_part_in_a_million_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    for size, known in ((0.9, False), (1.1, True)):
        solved(monkeypatch, {GAIN.name: size})
        assert (searching()._freed(GAIN) is not None) == known


@pytest.mark.slow
def test_a_force_that_one_record_takes_for_friction_is_seen_in_another() -> None:
    loaded = model_of(TWO.replace('coulomb = "F_sl"', 'coulomb = "F_sl", offset = "F_0"'), "both")
    truth, noise = {**TRUTH, "F_0": 0.15}, {"q_m": 1e-6, "q_l": 1e-6, "T": 2e-3}
    chirp, trapezoid = (
        simulate(loaded, truth, motion, fs=2000.0, duration_s=2.0, noise=noise, seed=one).record
        for one, motion in enumerate(("chirp", "trapezoid"))
    )
    # the chirp goes ahead only, and friction is a constant there
    found = identify(model_of(TWO, "both"), [chirp, trapezoid.part(0, int(0.45 * trapezoid.n), "there")])
    assert any("a constant force (offset) acts on l" in one.what for one in found.checks.advice)
    for one in found.parameters.physical:
        assert abs(one.value - TRUTH[one.name]) < 3.0 * one.std
    spread = {one.name: one.std / TRUTH[one.name] for one in found.parameters.physical}
    assert spread["F_sl"] < 0.01  # it was 105 % off at 18 deviations


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 4])
def test_friction_that_the_spec_does_not_name_takes_samples_about_reversals_along(seed: int) -> None:
    # about reversals it holds what would move, and had passed for friction of the motor
    unnamed = model_of(TWO.replace(', viscous = "F_vl", coulomb = "F_sl"', ""), "both")
    noise = {"q_m": 1e-5, "q_l": 1e-5, "T": 2e-3}
    truth = {**TRUTH, "F_vl": 0.0}
    records = [
        simulate(
            model_of(TWO, "both"), truth, motion, fs=2000.0, duration_s=2.0, noise=noise, seed=one
        ).record
        for one, motion in enumerate(("chirp", "trapezoid"), seed)
    ]
    found = identify(unnamed, records)
    assert any(
        "Coulomb friction that the spec does not name acts on l" in a.what for a in found.checks.advice
    )
    for one in found.parameters.physical:
        assert abs(one.value - TRUTH[one.name]) < 3.0 * one.std
    spread = {one.name: one.std / TRUTH[one.name] for one in found.parameters.physical}
    assert spread["F_sm"] < 0.01 and spread["K"] < 1e-3
    assert all(row.masked > 0 for row in found.fit.rows if row.row == "l")


def test_what_a_dropped_effect_moved_is_not_in_the_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    by_misfit(monkeypatch)

    def fit(x: float) -> Freed:
        return Freed(cast(Any, None), cast(Any, leaving(-x, x)), job().setting(), (1e-6,), (1e-7,))

    form = replace(OTHER, name="a form", kind="form")
    search = replace(searching(), now=fit(0.0))._with([(form, (form,), fit(1.0))])
    assert search.drift[0, 0] > 0.0
    monkeypatch.setattr(Search, "_freed", lambda *given: None)
    assert search._with([(FRICTION, (form, FRICTION), fit(2.0))]).drift[0, 0] > 1.0
    # what is estimated without it is as exact as ever
    assert search._with([(FRICTION, (FRICTION,), fit(2.0))]).drift[0, 0] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1.028, 0.985])
def test_a_gain_is_seen_where_rows_are_mostly_noise(gain: float) -> None:
    """With the gain parameters grow, and with them the noise of the rows: what is left is no more for it."""
    text = TWO.replace(', viscous = "F_vl", coulomb = "F_sl"', "").replace(
        'q_l = { body = "l", measures = "position" }', 'a_l = { body = "l", measures = "acceleration" }'
    )
    model, truth = (
        model_of(text, "both"),
        {key: TRUTH[key] for key in TRUTH if key[:2] != "F_" or key[-1] == "m"},
    )
    noise = {"q_m": 2e-5, "a_l": 2.0, "T": 8e-3}
    records = []
    for seed, motion in enumerate(("chirp", "trapezoid")):
        one = simulate(model, truth, motion, fs=4000.0, duration_s=1.5, noise=noise, seed=seed).record
        records.append(Record({**one.signals, "a_l": gain * one.signals["a_l"]}, one.fs, motion))
    found = identify(model, records)
    print(
        [a.what for a in found.checks.advice],
        [(p.name, p.value / truth[p.name] - 1, p.std / truth[p.name]) for p in found.parameters.physical],
    )
    for one in found.parameters.physical:
        assert abs(one.value - truth[one.name]) < 3.0 * one.std
