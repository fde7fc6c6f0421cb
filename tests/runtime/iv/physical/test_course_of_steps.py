"""Steps that leave more than before are shortened, and those that lead away from a chain are refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.physical.course_of_steps import Course
from modelgen.runtime.iv.physical.gauss_newton_step import Unknowns
from modelgen.runtime.iv.physical.physical_iv import PLAIN
from modelgen.runtime.model.model import model_from_module

MODEL = model_from_module(emps300_qm_qc)
VALUES = np.arange(1.0, 1.0 + len(MODEL.parameters))


def left(mean: float) -> Any:
    """Return a step at whose begin rows leave so much, a mean logarithm."""
    return SimpleNamespace(left=mean)


def course() -> Course:
    return Course(MODEL, VALUES, PLAIN, 1e-3)


def test_steps_that_lead_away_from_a_chain_name_what_the_records_do_not_hold() -> None:
    away = np.where(np.isin(MODEL.parameters, ("J_c",)), 1e-2, 1.0) * VALUES
    away *= np.where(np.isin(MODEL.parameters, ("K",)), 20.0, 2.0)
    names = ", ".join(name for name in MODEL.parameters if name in ("J_c", "K"))
    with pytest.raises(IdentifiabilityError, match=f"do not hold {names}: steps lead"):
        course().refuse_led_away(Unknowns(away, {}), 10.0)
    course().refuse_led_away(Unknowns(2.0 * VALUES, {}), 10.0)


def test_half_of_a_step_is_gone_where_rows_leave_far_more_at_its_end() -> None:
    steps, begin, move = course(), Unknowns(VALUES, {}), 0.1 * VALUES
    assert steps.instead(left(3.0)) is None  # the first one comes from nowhere
    steps.leads_on(left(1.0))
    assert steps.on(begin, move).p == pytest.approx(1.1 * VALUES)
    half = steps.instead(left(2.0))
    assert half is not None and half.p == pytest.approx(1.05 * VALUES)
    quarter = steps.instead(left(2.0))
    assert quarter is not None and quarter.p == pytest.approx(1.025 * VALUES)
    assert steps.instead(left(1.1)) is None
    # the next ones grow again
    assert steps.on(begin, move).p == pytest.approx(1.05 * VALUES)
    assert steps.on(begin, move).p == pytest.approx(1.1 * VALUES)


def test_a_step_of_which_a_little_leaves_as_much_is_gone_after_all() -> None:
    steps = course()
    steps.leads_on(left(1.0))
    steps.on(Unknowns(VALUES, {}), 0.1 * VALUES)
    tried = [steps.instead(left(9.0)) for _ in range(10)]
    assert sum(one is not None for one in tried) == 5


def test_steps_lead_on_while_rows_leave_less() -> None:
    falling, restless = course(), course()
    assert [falling.leads_on(left(-0.05 * n)) for n in range(20)][-1]
    assert not [restless.leads_on(left(0.3 * (-1) ** n)) for n in range(20)][-1]


def test_rows_that_effects_change_do_not_tell() -> None:
    steps = course()
    steps.leads_on(left(1.0))
    steps.on(Unknowns(VALUES, {}, (1e-3,)), np.append(0.1 * VALUES, 0.0))
    assert steps.instead(left(9.0)) is None
