"""Where steps in physical parameters begin near an estimate, and what is simulated then."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.model_errors import delay_effect
from modelgen.runtime.iv.physical import composite_iv, physical_iv
from modelgen.runtime.iv.physical.composite_iv import fit_composites_iv
from modelgen.runtime.iv.physical.gauss_newton_step import Unknowns
from modelgen.runtime.iv.physical.physical_iv import Rows, fit_physical_iv
from modelgen.runtime.iv.thresholds import STILL_ROUNDS
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation, observe
from tests.runtime.iv.physical.test_composite_iv import motor_only, noisy


def motor_alone() -> tuple[Setting, Rows]:
    model, records = motor_only("emps300"), noisy("light", 0)
    setting = Setting(model, records, choose_filter(model, records))

    def rows(moved: tuple[Record, ...]) -> Observation:
        return observe(model, moved, setting.choice).dense()

    return setting, rows


@pytest.mark.slow
def test_steps_near_an_estimate_that_lead_nowhere_are_not_begun_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    setting, rows = motor_alone()
    tried: list[tuple[object, object]] = []

    def restless(_: Setting, __: object, delays: object, start: object, *more: object) -> None:
        tried.append((start, delays))
        raise IdentifiabilityError.at("method iv", "steps do not come to rest", "record more")

    monkeypatch.setattr(composite_iv, "fit_physical_iv", restless)
    truth, late = dict(setting.model.parameter_sets["light"]), ("Gamma_m",)
    delays = {"Gamma_m": 1e-4}
    with pytest.raises(IdentifiabilityError, match="do not come to rest"):
        fit_composites_iv(setting, rows, late, begin=truth, known_delays=delays)
    # what is late may have to be held there; without its delay steps went the same way, or in vain
    assert all(start == truth for start, _ in tried)
    assert [held for _, held in tried if held] == [delays]
    tried.clear()
    with pytest.raises(IdentifiabilityError):
        fit_composites_iv(setting, rows, late, begin=truth)
    assert tried[0] == (truth, {"Gamma_m": 0.0})
    assert any(start != truth for start, _ in tried)


def test_steps_from_an_estimate_do_not_leave_it_by_a_factor_of_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    setting, rows = motor_alone()
    truth, most = dict(setting.model.parameter_sets["light"]), list[float]()
    inertia = setting.model.parameters.index("J_c")

    def growing(_: Setting, __: object, now: Unknowns, *more: object) -> SimpleNamespace:
        most.append(float(now.p[inertia]) / truth["J_c"])
        return SimpleNamespace(
            x=np.r_[4.0 * now.p, np.zeros(len(now.delays))], spread=1e-3 * now.vector, left=0.0
        )

    monkeypatch.setattr(physical_iv, "step_from", growing)
    with pytest.raises(IdentifiabilityError, match="steps lead to where there is no such chain"):
        fit_composites_iv(setting, rows, (), begin=truth, known_delays={})
    assert 5.0 < max(most) < 10.0


def test_a_fit_in_physical_parameters_is_simulated_with_these(monkeypatch: pytest.MonkeyPatch) -> None:
    setting, rows = motor_alone()
    truth = dict(setting.model.parameter_sets["light"])
    found = fit_physical_iv(setting, rows, {}, truth, settled=True)
    far_back = simulation_parameters(setting.model, replace(found.fit, carried=None))

    def solved(*_: object) -> None:
        raise AssertionError("what is known is solved for")

    monkeypatch.setattr("modelgen.runtime.iv.instrumental_variables.nearest_parameters", solved)
    known = simulation_parameters(setting.model, found.fit)
    assert known == found.values(setting.model)
    assert far_back == {name: pytest.approx(value, rel=1e-8) for name, value in known.items()}
    # what was taken off since counts
    less = replace(found.fit.solution, x=0.999 * found.fit.solution.x)
    with pytest.raises(AssertionError, match="is solved for"):
        simulation_parameters(setting.model, replace(found.fit, solution=less))


@pytest.mark.parametrize(("moves", "rounds"), [([2.0] * 30 + [0.01], 31), ([4.0] * 60, 25), ([2.0] * 60, 40)])
def test_steps_that_creep_go_on_and_others_end(
    moves: list[float], rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`moves` are those of each step, in standard deviations."""
    setting, rows = motor_alone()
    truth, waiting, told = dict(setting.model.parameter_sets["light"]), iter(moves), list[int]()

    def step(_: Setting, __: object, now: Unknowns, *more: object) -> SimpleNamespace:
        spread = 1e-6 * np.abs(now.p)
        return SimpleNamespace(x=now.p + next(waiting) * spread, spread=spread, uncertainty=spread, left=0.0)

    def counted(_: object, __: object, done: int) -> SimpleNamespace:
        told.append(done)
        return SimpleNamespace(carried=None)

    monkeypatch.setattr(physical_iv, "step_from", step)
    monkeypatch.setattr(physical_iv, "in_base_columns", counted)
    if moves[-1] < 1.0:
        fit_physical_iv(setting, rows, {}, truth, settled=True)
        assert told == [rounds]
    else:
        with pytest.raises(IdentifiabilityError, match=f"after {rounds} rounds"):
            fit_physical_iv(setting, rows, {}, truth, settled=True)


def test_steps_that_go_round_end_once_they_did(monkeypatch: pytest.MonkeyPatch) -> None:
    setting, rows = motor_alone()
    truth, waiting = dict(setting.model.parameter_sets["light"]), iter([2.0, 2.0, -4.0] * 20)
    size = 1e-6 * np.abs([truth[name] for name in setting.model.parameters])

    def step(_: Setting, __: object, now: Unknowns, *more: object) -> SimpleNamespace:
        return SimpleNamespace(x=now.p + next(waiting) * size, spread=size, left=0.0)

    monkeypatch.setattr(physical_iv, "step_from", step)
    monkeypatch.setattr(physical_iv.AndersonSteps, "combined", lambda _, at, move, scale: move)
    # not before small steps would do
    with pytest.raises(IdentifiabilityError, match=f"after {STILL_ROUNDS + 1} rounds"):
        fit_physical_iv(setting, rows, {}, truth, settled=True)


def test_an_effect_that_no_record_can_have_ends_the_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    setting, rows = motor_alone()
    late = delay_effect("q_m")
    setting, truth = replace(setting, effects=(late,), sizes=(0.0,)), setting.model.parameter_sets["light"]

    def step(_: Setting, __: object, now: Unknowns, *more: object) -> SimpleNamespace:
        # a thousand seconds late: its record would have to be continued by millions of samples
        return SimpleNamespace(x=np.r_[now.p, 1e3], spread=np.ones(len(now.p) + 1), left=0.0)

    monkeypatch.setattr(physical_iv, "step_from", step)
    with pytest.raises(IdentifiabilityError, match=f"{late.name} runs away"):
        fit_physical_iv(setting, rows, {}, dict(truth), settled=True)
