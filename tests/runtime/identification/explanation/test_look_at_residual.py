"""Which form of a link is taken, and what stays open where none of the known ones is right."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation import look_at_residual
from modelgen.runtime.identification.explanation import search as module
from modelgen.runtime.identification.explanation.explain_residual import found_by
from modelgen.runtime.identification.explanation.explained import run_method
from modelgen.runtime.identification.explanation.look_at_residual import (
    believable,
    look,
    moves_of_forms,
)
from modelgen.runtime.identification.explanation.search import Search
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.iv.effect import Effect, unlike
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import RAMPS, SMALL, two_mass_records

EFFECTS = {one.name: one for one in effects_of(SMALL, ("m", "c"), RAMPS, turning=True)}
STIFFENS, GAP, LATE = (EFFECTS[name] for name in ("stiffening of K", "backlash of K", "delay of q_c"))


def fitted(misfit: float, *x: float) -> Freed:
    """A fit that leaves so much and ends at some X, with one effect estimated."""
    at = SimpleNamespace(x=np.array(x))
    fit = SimpleNamespace(
        misfit=misfit, blocks=(), delays=(), solution=at, simulated=None, carried=None, unknown=()
    )
    return Freed(cast(Any, None), cast(Any, fit), cast(Any, None), (1e-4,), (1e-6,))


def searching(now: Freed) -> Search:
    job = Job(SMALL, tuple(RAMPS), cast(Any, None))
    return Search(job, None, replace(now, sizes=(), stds=()), (), 0, {}, np.zeros((2, 2)))


def test_both_forms_of_a_link_are_looked_for_and_once_each() -> None:
    assert [one.name for one in STIFFENS.forms] == [GAP.name]
    assert [one.name for one in GAP.forms] == [STIFFENS.name]
    assert unlike((STIFFENS, GAP), ()) == (STIFFENS, GAP)
    assert unlike((STIFFENS, GAP), (GAP.forms[0],)) == (GAP,)
    # effects of one name at several settings stay
    again = replace(STIFFENS)
    assert unlike((STIFFENS, again, GAP), (GAP,)) == (STIFFENS, again)


@pytest.mark.parametrize("shown", [(STIFFENS,), (GAP,), (GAP, STIFFENS)])
def test_both_forms_are_tried_whichever_explains_more_along_its_tangent(
    shown: tuple[Effect, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Search, "_freed", lambda self, effect, size=0.0: ((effect,), fitted(0.0, 1.0, 1.0)))
    every = [Score(one, 1.0, 0.01, 0.5, np.zeros(2), 1.0, 1.0, 0.1, True) for one in shown]
    tried = [one for one, *_ in searching(fitted(0.0, 1.0, 1.0))._tried(every)]
    expected = (*shown, *(one for one in (STIFFENS, GAP) if one not in shown))
    assert sorted(one.name for one in tried) == sorted(one.name for one in expected)
    assert all(one in tried for one in shown)


def test_other_forms_move_x_and_what_is_no_form_does_not() -> None:
    before, taken, other, elsewhere = (fitted(0.0, 1.0, x) for x in (5.0, 4.0, 6.0, 9.0))
    tried = [(STIFFENS, taken), (GAP, other), (LATE, elsewhere)]
    moves = moves_of_forms(before.fit, STIFFENS, taken, tried)
    np.testing.assert_allclose(moves, [[0.0, -1.0], [0.0, 2.0]])
    assert not moves_of_forms(before.fit, LATE, taken, tried).size


@pytest.mark.parametrize("quiet", [True, False])
def test_intervals_hold_all_forms_of_a_link_where_none_leaves_noise(
    quiet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "left_of_each", lambda job, found, moved: [fit.misfit for fit, *_ in found])
    monkeypatch.setattr(module, "leaves_noise", lambda job, fit: quiet)
    taken, other = fitted(-50.0, 1.0, 4.0), fitted(-20.0, 1.0, 6.0)
    found = searching(fitted(0.0, 1.0, 5.0))._with([(GAP, (GAP,), other), (STIFFENS, (STIFFENS,), taken)])
    assert found.effects == (STIFFENS,)
    inexact = (0.05 * -1.0) ** 2
    assert found.drift[1, 1] == pytest.approx(inexact if quiet else inexact + 1.0 + 2.0**2)
    # what follows leaves noise alone: then the form was right
    monkeypatch.setattr(module, "leaves_noise", lambda job, fit: True)
    after = found._with([(LATE, (STIFFENS, LATE), replace(taken, sizes=(1e-4, 1e-4), stds=(1e-6, 1e-6)))])
    assert after.drift[1, 1] == pytest.approx(inexact)


def with_encoders(step: float) -> list[Record]:
    """Records whose encoders have steps of so many rad; as measured for 0."""
    if not step:
        return list(two_mass_records())
    return [
        Record(
            {key: step * np.round(x / step) if key[0] == "q" else x for key, x in one.signals.items()},
            one.fs,
            one.name,
        )
        for one in two_mass_records()
    ]


@pytest.mark.parametrize(("step", "matters"), [(0.0, True), (2.0 * np.pi / 4096, False)])
def test_what_rounding_of_encoders_looks_like_does_not_matter(
    step: float, matters: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gap of a thousandth of such a step, said to be known to a fifth of itself."""
    task = prepared(SMALL, with_encoders(step), Auto(), Filters(), CheckOptions())
    begun, size = run_method(task, IV()), 1e-3 * 2.0 * np.pi / 4096
    real = look_at_residual.scores

    def certain(*given: Any) -> tuple[Score, ...]:
        gap = next(one for one in real(*given) if one.effect.name == GAP.name)
        return (replace(gap, size=size, std=size / 5.0, least=0.6 * size, matters=True, likely=True),)

    monkeypatch.setattr(look_at_residual, "scores", certain)
    monkeypatch.setattr(look_at_residual, "_without_noise", lambda found, *_: found)
    monkeypatch.setattr(look_at_residual, "within_rounding", lambda *_: not matters)
    found = begun.found
    (gap,) = look(task.job, found_by(task.job, found.observation, found.fit), (), None).found
    assert gap.matters == gap.likely == matters
    assert (gap.least > 0.6 * size) != matters


@pytest.mark.parametrize(("periods", "can_be"), [(0.4, True), (-0.4, True), (0.6, False), (-40.0, False)])
def test_directions_are_no_half_period_of_their_low_pass_late(periods: float, can_be: bool) -> None:
    """A record without friction to speak of gave directions that change a second early."""
    records = tuple(two_mass_records())
    job = Job(SMALL, records, choose_filter(SMALL, records))
    late = next(one for one in EFFECTS.values() if one.name == "direction of m")
    assert believable(job, late, periods / job.choice.direction_cutoff_hz, {}) == can_be


def test_noise_of_forces_looks_alike_in_what_are_columns_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """J_m of either record: together they are the column of J_m, and its noise is in the instruments."""
    rng, records = np.random.default_rng(0), []
    for one in two_mass_records():
        force = one.signals["Gamma_m"]
        noisy = force + 0.3 * np.std(force) * rng.standard_normal(one.n)
        records.append(Record(dict(one.signals) | {"Gamma_m": noisy}, one.fs, one.name))
    task = prepared(SMALL, records, Auto(), Filters(), CheckOptions())
    found, real, shifts = run_method(task, IV()).found, look_at_residual.scores, []

    def mattering(*given: Any) -> tuple[Score, ...]:
        either = [one for one in real(*given) if one.effect.name.startswith("J_m of record")]
        return tuple(replace(one, matters=True, least=0.0) for one in either)

    def kept(found: Any, *given: Any) -> tuple[Score, ...]:
        before, after = found, without(found, *given)
        sizes = {one.effect.name: one.size for one in after}
        shifts.extend(one.power * (one.size - sizes[one.effect.name]) for one in before)
        return tuple(after)

    without = look_at_residual._without_noise
    monkeypatch.setattr(look_at_residual, "scores", mattering)
    monkeypatch.setattr(look_at_residual, "_without_noise", kept)
    look(task.job, found_by(task.job, found.observation, found.fit), (), None)
    one, other = shifts
    assert abs(one + other) < 0.3 * max(abs(one), abs(other))  # else both have one sign
