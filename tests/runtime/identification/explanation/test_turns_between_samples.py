"""Joints reverse at samples or between them: the rows say which."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, Record, identify
from modelgen.runtime.identification.explanation.wider_directions import with_turns_between_samples
from modelgen.runtime.identification.given_positions import about_the_estimate
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.arms.fast_excitation import fast_excitation
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of
from tests.runtime.planning.arms.test_fast_excitation import POSTURE, arm

QUICK = CheckOptions(tests=False, drift_check=False)
CUTOFF_HZ = 50.0


@lru_cache(maxsize=1)
def fast() -> tuple[Model, dict[str, float], Record]:
    """Return a record about the modes in closed loop, without noise: drives let friction bend the motion."""
    model, values, joints = arm()
    planned = fast_excitation(model, values, joints, POSTURE, 5.0).trajectory
    motion = JointMotion(*planned.at(np.arange(5001) / 1000.0), 1000.0)
    moved = simulate_arm(model, values, JointReference(motion, "fast"))
    true = {key: moved.true[key] for key in model.channels}
    return model, values, Record(true, 1000.0, "fast")


def chosen(model: Model, record: Record) -> bool:
    task = prepared(model, [record], WLS(), Filters(cutoff_hz=CUTOFF_HZ), QUICK)
    return with_turns_between_samples(about_the_estimate(task)[0]).choice.between


@pytest.mark.slow
def test_smooth_forces_let_joints_reverse_between_samples() -> None:
    model, values, record = fast()
    assert chosen(model, record)
    found = identify(model, record, "wls", Filters(cutoff_hz=CUTOFF_HZ), QUICK)
    assert found.fit.filtering.between
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    # sampled directions leave 0.01 to 0.05 %
    for name in ("Fs_1", "Fs_2", "Fv_1", "Fv_2"):
        assert found.params[name] == pytest.approx(exact[name], rel=2e-3), name


def test_forces_that_follow_a_smooth_motion_jump_at_samples() -> None:
    model = model_of(catalogued("two_link"))
    assert not chosen(model, record_of(model, values_of(model), noise=(1e-5, 0.1)))
