"""What becomes of steps in physical parameters that know nothing of their chain."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.iv.physical import gauss_newton_step
from modelgen.runtime.iv.physical.gauss_newton_step import GaussNewtonStep, Unknowns
from modelgen.runtime.iv.physical.physical_iv import _lost, _restless
from modelgen.runtime.model.model import model_from_module

MODEL = model_from_module(emps300_qm_qc)
VALUES = np.arange(1.0, 1.0 + len(MODEL.parameters))


def test_steps_without_rest_name_what_nothing_holds() -> None:
    spread = np.where(np.isin(MODEL.parameters, ("J_c", "K")), 2.0, 0.1) * VALUES
    told = str(_restless(MODEL, VALUES, spread, 25))
    assert "the records do not hold J_c, K: " in told
    assert "--delay none" in told
    assert "still move" in str(_restless(MODEL, VALUES, 0.1 * VALUES, 25))


def test_bodies_springs_and_delays_are_lost_by_their_size() -> None:
    setting = SimpleNamespace(model=MODEL, choice=SimpleNamespace(cutoff_hz=100.0))
    now = Unknowns(VALUES, {"Gamma_m": 0.0})
    # friction may be anything: only inertias and stiffnesses have a size that they need
    spread = np.r_[2.0 * VALUES, 1e-3]
    lost = [name for name in MODEL.parameters if MODEL.roles[name].role in ("inertia", "stiffness")]
    assert _lost(setting, now, spread) == tuple(lost)  # type: ignore[arg-type]
    late = np.r_[0.1 * VALUES, 2e-3]
    assert _lost(setting, now, late) == ("Gamma_m",)  # type: ignore[arg-type]


def test_a_body_that_vanishes_beside_a_delay_is_lost_with_its_link() -> None:
    setting = SimpleNamespace(model=MODEL, choice=SimpleNamespace(cutoff_hz=100.0))
    values = np.where(np.isin(MODEL.parameters, ("J_c",)), 1e-4, 1.0) * VALUES
    spread = np.r_[0.01 * values, 1e-6]
    gone = ("J_c", "F_vmc", "K")
    assert _lost(setting, Unknowns(values, {"Gamma_m": 2e-5}), spread) == gone  # type: ignore[arg-type]
    assert _lost(setting, Unknowns(values, {}), spread[:-1]) == ()  # type: ignore[arg-type]


def test_of_columns_beyond_the_rank_of_the_rows_nothing_is_known() -> None:
    solution = SimpleNamespace(undetermined=np.array([False, True]), inverse=np.eye(2))
    linear = SimpleNamespace(columns=("a", "held", "b"))
    white = SimpleNamespace(columns=("a", "b"), solution=solution)
    step = GaussNewtonStep(white, (), np.eye(2), linear, white, ())  # type: ignore[arg-type]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gauss_newton_step, "hac_covariance", lambda _: np.diag([4.0, 0.0]))
        assert step.spread.tolist() == [2.0, 0.0, 0.0]
        assert step.uncertainty.tolist() == [2.0, 0.0, np.inf]
