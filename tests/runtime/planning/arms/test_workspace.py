from __future__ import annotations

import random

import numpy as np
import pytest

from modelgen.cli.arms.design_arm import planned_joints
from modelgen.errors import DataError
from modelgen.runtime.planning.arms.workspace import (
    Box,
    acceleration_bounds,
    check_boxes,
    clearance,
    clearances,
    limits_of,
    origins,
)
from modelgen.symbolic.arms.dynamics.geometry import link_poses
from modelgen.symbolic.arms.expressions.evaluation import sampled
from modelgen.symbolic.arms.expressions.graph import Graph
from tests.runtime.simulation.arms.test_fourier_trajectory import random_trajectory
from tests.symbolic.arms.made_arms import random_arm, tx40

ARMS = [tx40(), *(random_arm(random.Random(seed)) for seed in range(6))]


@pytest.mark.parametrize("number", range(len(ARMS)))
def test_frames_stand_where_the_geometric_model_has_them(number: int) -> None:
    spec, graph = ARMS[number], Graph()
    joints, q = planned_joints(spec), np.random.default_rng(number).standard_normal((len(spec.moving), 5))
    found = origins(joints, q, [joint.name for joint in joints])
    motion = {(joint.name, 0): values for joint, values in zip(spec.moving, q, strict=True)}
    for name, pose in link_poses(graph, spec).items():
        np.testing.assert_allclose(found[name], sampled(graph, pose.origin, motion, {}), atol=1e-12)


@pytest.mark.parametrize("number", range(len(ARMS)))
def test_no_frame_is_accelerated_beyond_its_bound(number: int) -> None:
    spec, one = ARMS[number], random_trajectory(number, len(ARMS[number].moving))
    joints, names = planned_joints(spec), [joint.name for joint in spec.joints]
    step = 1e-4 * one.period_s
    times = np.linspace(0.0, one.period_s, 400)
    before, at, after = (origins(joints, one.at(times + k * step)[0], names) for k in (-1, 0, 1))
    bounds = acceleration_bounds(joints, one.bounds())
    for name in names:
        found = np.linalg.norm(after[name] - 2 * at[name] + before[name], axis=1).max() / step**2
        assert found <= bounds[name] * (1 + 1e-6) + 1e-6


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_a_box_that_is_proven_is_kept_between_samples(inside: bool, seed: int) -> None:
    spec = ARMS[seed]
    joints, one = planned_joints(spec), random_trajectory(seed, len(spec.moving))
    frame = spec.joints[-1].name
    dense = origins(joints, one.at(np.linspace(0.0, one.period_s, 20_001))[0], [frame])[frame]
    rng = np.random.default_rng(seed)
    for _ in range(20):
        middle = dense[rng.integers(len(dense))] + rng.standard_normal(3) * (0.0 if inside else 0.5)
        half = rng.uniform(0.05, 3.0, 3) * (5.0 if inside else 0.2)
        box = Box(frame, tuple(middle - half), tuple(middle + half), inside)
        (room,) = clearances([box], joints, one, one.bounds())
        within = np.all((dense > middle - half) & (dense < middle + half), axis=1)
        assert room < 0.0 or (within.all() if inside else not within.any())
    far = Box(frame, (-1e4,) * 3, (1e4,) * 3) if inside else Box(frame, (1e4,) * 3, (2e4,) * 3, False)
    assert clearances([far], joints, one, one.bounds())[0] > 1e3


def test_a_chord_that_cuts_a_corner_is_seen() -> None:
    box = Box("a", (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), inside=False)
    across = np.array([[-0.1, 0.5, 0.0], [1.1, 0.5, 0.0]])
    assert clearance(box, across) < 0.0
    assert clearance(box, across + np.array([0.0, 1.0, 0.0])) == pytest.approx(0.5)


def test_mistakes_are_all_told() -> None:
    joints = planned_joints(tx40())
    with pytest.raises(DataError, match="joint 1: position_limits") as error:
        limits_of(joints)
    assert len(error.value.problems) == 12
    with pytest.raises(DataError, match="is no joint's frame") as error:
        check_boxes([Box("tol", (0.0,) * 3, (1.0,) * 3), Box("6", (1.0, 0.0, 0.0), (0.0, 1.0, 1.0))], joints)
    assert [problem.what for problem in error.value.problems] == ["is no joint's frame", "has no room"]
