from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.cli.arms.design_arm import planned_joints
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.planning.arms.exciting_trajectory import exciting_trajectory
from modelgen.runtime.planning.arms.workspace import Box
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.made_arms import serial
from tests.symbolic.arms.test_gains import with_gains

ROWS = [(0, 0, 0, 0.3), (-90, 0, 0, 0.1), (0, 0.4, 0, 0)]
INF = np.inf


def limited(spec: ArmSpec) -> ArmSpec:
    limits = [((-2.0, 1.0), 3.0, None), ((-1.5, 1.5), 2.0, 6.0), ((0.2, 2.2), 4.0, 9.0)]
    joints = [
        replace(joint, position_limits=position, speed_limit=speed, acceleration_limit=acceleration)
        for joint, (position, speed, acceleration) in zip(spec.joints, limits, strict=True)
    ]
    return replace(spec, joints=tuple(joints))


def module_of(spec: ArmSpec) -> Any:
    names: dict[str, Any] = {}
    exec(compile(arm_module(arm_base_model(arm_rows(spec))), "module", "exec"), names)
    return SimpleNamespace(**names)


SPEC = limited(serial(ROWS, True))
SEARCH: Any = {"period_s": 4.0, "seeds": 2, "rounds": 25}


@pytest.mark.parametrize("criterion", ["condition", "d-optimal"])
def test_limits_hold_everywhere_and_the_search_gains(criterion: str) -> None:
    module, joints = module_of(SPEC), planned_joints(SPEC)
    found = exciting_trajectory(module, joints, criterion=criterion, **SEARCH)
    times = np.linspace(0.0, 4.0, 50_001)
    q, speed, acceleration = found.trajectory.at(times)
    for k, joint in enumerate(SPEC.moving):
        low, high = joint.position_limits or (0.0, 0.0)
        assert low <= found.bounds.lower[k] <= q[k].min() and q[k].max() <= found.bounds.upper[k] <= high
        assert np.abs(speed[k]).max() <= found.bounds.speed[k] <= (joint.speed_limit or 0.0)
        limit = joint.acceleration_limit or INF
        assert np.abs(acceleration[k]).max() <= found.bounds.acceleration[k] <= limit
    assert len(found.costs) == 2 and all(end < start for start, end in found.costs if start and end)
    signals = {key: np.zeros(times.size) for key in module.SIGNALS}
    for k, name in enumerate(found.joints):
        for order, values in zip(("q", "d1_q", "d2_q"), (q, speed, acceleration), strict=True):
            signals[f"{order}_{name}"] = values[k]
    regressor = module.regressor(signals)[::25].reshape(-1, len(module.BASE_PARAMETERS))
    assert np.linalg.cond(regressor) == pytest.approx(found.condition, rel=0.1)
    again = exciting_trajectory(module, joints, criterion=criterion, **SEARCH)
    np.testing.assert_array_equal(again.trajectory.sines, found.trajectory.sines)


def test_boxes_are_kept_and_what_cannot_be_kept_is_told() -> None:
    module, joints = module_of(SPEC), planned_joints(SPEC)
    above = Box("3", (-INF, -INF, 0.2), (INF, INF, INF))
    boxes = (above, Box("3", (-0.1, -0.1, -INF), (0.1, 0.1, INF), False))
    found = exciting_trajectory(module, joints, boxes=boxes, **SEARCH)
    assert all(room >= 0.0 for _, room in found.boxes)
    never = (replace(above, lower=(-INF, -INF, 2.0)),)
    with pytest.raises(DataError, match=r"kept by none of 2,000 postures .* frame 3 in z 2 to inf m by 1\."):
        exciting_trajectory(module, joints, boxes=never, **SEARCH)


def test_gains_are_left_to_the_measurement() -> None:
    spec = limited(with_gains(serial(ROWS, True)))
    plain = exciting_trajectory(module_of(SPEC), planned_joints(SPEC), **SEARCH)
    found = exciting_trajectory(module_of(spec), planned_joints(spec), **SEARCH)
    assert found.condition == pytest.approx(plain.condition, rel=1e-6)


def test_columns_that_no_trajectory_tells_apart_are_told() -> None:
    module = module_of(SPEC)

    def twice(signals: Any) -> Any:
        found = module.regressor(signals)
        return np.concatenate([found, found[:, :, :1]], axis=2)

    blind = SimpleNamespace(SIGNALS=module.SIGNALS, regressor=twice)
    with pytest.raises(IdentifiabilityError, match="no trajectory: distinguishes the base parameters"):
        exciting_trajectory(blind, planned_joints(SPEC), **SEARCH)


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"criterion": "worst"}, "criterion"),
        ({"period_s": 0.0}, "duration"),
        ({"harmonics": 1}, "harmonics"),
        ({"seeds": 0}, "seeds"),
    ],
)
def test_options_that_cannot_be_used_are_told(options: Any, where: str) -> None:
    with pytest.raises(DataError) as error:
        exciting_trajectory(module_of(SPEC), planned_joints(SPEC), **options)
    assert error.value.problems[0].where == where
