"""The fast stage of an elastic arm's excitation: about its modes, within limits, from rest to rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen import CheckOptions, identify
from modelgen.cli.arms.design_arm import planned_joints
from modelgen.cli.arms.simulate_arm import arm_model, mounted
from modelgen.errors import DataError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.planning.arms.fast_excitation import FastExcitation, fast_excitation
from modelgen.runtime.planning.arms.predicted_sets import USUAL_NOISE
from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.arm_plant import arm_plant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, JointReference, fourier_reference
from modelgen.runtime.simulation.arms.mounted_sensors import sensor_channels
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.arm_sensor_sets import with_usual_sets
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.runtime.made_arm_records import catalogued

POSTURE = np.array([0.2, 0.8])


@cache
def arm() -> tuple[Model, dict[str, float], tuple[PlannedJoint, ...]]:
    spec = catalogued("elastic_two_link")
    limited = (replace(joint, position_limits=(-2.0, 2.0), speed_limit=3.0) for joint in spec.joints)
    spec = replace(spec, joints=tuple(limited))
    model = arm_model(spec)
    return model, dict(model.parameter_sets["nominal"]), tuple(planned_joints(spec))


def found(period_s: float = 5.0, boxes: tuple[Box, ...] = ()) -> FastExcitation:
    model, values, joints = arm()
    return fast_excitation(model, values, joints, POSTURE, period_s, boxes)


def test_it_moves_about_the_modes_from_rest_to_rest_within_the_limits() -> None:
    fast = found()
    q, v, a = fast.trajectory.at(np.linspace(0.0, 5.0, 20_001))
    assert np.abs(v[:, [0, -1]]).max() < 1e-9 and np.abs(a[:, [0, -1]]).max() < 1e-7
    assert np.abs(v).max() < 3.0 and np.abs(v).max(axis=1).min() > 1.5
    assert np.abs(q - POSTURE[:, None]).max() < 0.05 * 4.0
    # held motors: 5.9 to 6.7 Hz and 16 to 24 Hz over the workspace
    low, high = fast.band_hz
    assert 2.5 < low < 3.5 and 18.0 < high < 30.0
    spectra = np.abs(np.fft.rfft(q[:, :-1], axis=1))[:, 1:]
    lines = spectra > 1e-6 * spectra.max()
    hertz = np.arange(1, lines.shape[1] + 1) / 5.0
    assert not (lines[0] & lines[1]).any()  # each joint has harmonics of its own
    assert all(low <= hertz[one].min() and hertz[one].max() <= high for one in lines)


@pytest.mark.slow
def test_boxes_make_it_smaller() -> None:
    at = 0.5 * np.sin(POSTURE[0])  # where the second joint stands
    narrow = found(boxes=(Box("2", (-1.0, -1.0, at - 0.01), (1.0, 1.0, at + 0.01)),))
    assert narrow.bounds.speed.max() < 0.6 * found().bounds.speed.max()
    with pytest.raises(DataError, match="no room"):
        found(boxes=(Box("2", (-1.0, -1.0, at + 0.01), (1.0, 1.0, 1.0)),))


@pytest.mark.parametrize(("period_s", "what"), [(0.2, "or more"), (500.0, "at most")])
def test_periods_that_do_not_fit_are_told(period_s: float, what: str) -> None:
    with pytest.raises(DataError, match=what):
        found(period_s)


@pytest.mark.slow
def test_dampers_are_found_without_bias_by_motors_encoders_of_both_stages() -> None:
    """The low-pass of the fast stage let products of noise into the slow one: D was off by up to 2 %."""
    full, values, joints = arm()
    joints = tuple(replace(one, position=(-2.6, 2.6), speed=np.pi) for one in joints)
    spec = with_usual_sets(catalogued("elastic_two_link"))
    spec = replace(spec, sensor_sets={"s": spec.sensor_sets["motor encoders"]})
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set="s"))), "motors")
    limits = {one.name: JointLimits(one.position, one.speed, 100.0) for one in joints}
    slow = fourier_reference(full, 10.0, 1000.0, limits)
    fast = fast_excitation(full, values, joints, slow.motion.q[:, 0], 5.0).trajectory
    motion = JointMotion(*fast.at(np.arange(5001) / 1000.0), 1000.0)
    stages = (slow, JointReference(motion, "fast"))
    plant = arm_plant(full, full.base_from_physical(values))
    true = []
    for stage in stages:
        simulated = simulate_arm(full, values, stage)
        read = sensor_channels(plant, mounted(spec, model.sensor_set), simulated.motion)
        true.append(read | {name: simulated.true[name] for name in plant.forces})
    units = {one.key: one.unit for one in (*model.sensors, *model.actuators)}
    truth = dict(zip(model.base_parameters, model.base_from_physical(values).tolist(), strict=True))
    errors = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        records = [
            Record(
                {k: one[k] + USUAL_NOISE[units[k]] * rng.standard_normal(len(one[k])) for k in units}, 1e3, n
            )
            for one, n in zip(true, ("slow", "fast"), strict=True)
        ]
        estimate = identify(model, records, "wls", checks=CheckOptions(tests=False, drift_check=False))
        errors.append([estimate.params[name] / truth[name] - 1.0 for name in ("D_1", "D_2")])
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4e-3)
