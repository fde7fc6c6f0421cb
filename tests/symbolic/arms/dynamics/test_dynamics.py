from __future__ import annotations

import random
from dataclasses import replace
from itertools import chain

import numpy as np
import pytest

from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from modelgen.symbolic.arms.dynamics.direct_dynamics import direct_dynamics, mass_matrix
from modelgen.symbolic.arms.dynamics.geometry import jacobian, link_poses
from modelgen.symbolic.arms.dynamics.inverse_dynamics import inverse_dynamics
from modelgen.symbolic.arms.expressions.evaluation import sampled
from modelgen.symbolic.arms.expressions.graph import Graph
from modelgen.symbolic.arms.kinematics import link_motions
from tests.symbolic.arms.made_arms import ROBOTS, random_arm, serial, tx40
from tests.symbolic.arms.pinocchio_arms import (
    pinocchio,
    pinocchio_model,
    random_motion,
    random_parameters,
    state,
)
from tests.symbolic.arms.regressor_samples import regressor_at

ARMS = [serial(rows) for rows in ROBOTS.values()] + [random_arm(random.Random(s), light=0) for s in range(12)]
ARMS = [replace(spec, joints=tuple(replace(j, rotor_inertia=None, viscous=None, coulomb=None, offset=None)
                                   for j in spec.joints)) for spec in ARMS]  # fmt: skip
SAMPLES = 2


@pytest.mark.parametrize("spec", ARMS)
def test_dynamics_are_those_of_pinocchio(spec: ArmSpec) -> None:
    pin, rng = pinocchio(), np.random.default_rng(5)
    values, motion = random_parameters(spec, rng), random_motion(spec, SAMPLES, rng)
    model = pinocchio_model(spec, values)
    data, graph, count = model.createData(), Graph(), len(spec.moving)
    torques = inverse_dynamics(graph, spec)
    direct = direct_dynamics(graph, spec)
    forces = {f"force {joint.name}": float(k + 1) for k, joint in enumerate(spec.moving)}
    ours = sampled(graph, list(torques.values()), motion, values)
    rising = sampled(graph, list(direct.accelerations.values()), motion, {**values, **forces})
    loads = sampled(graph, direct.bias, motion, values)
    entries = sampled(graph, list(direct.mass.values()), motion, values)
    for sample in range(SAMPLES):
        q, v, a = state(spec, motion, sample)
        close(ours[sample], pin.rnea(model, data, q, v, a))
        close(loads[sample], pin.nonLinearEffects(model, data, q, v))
        upper = np.triu(pin.crba(model, data, q))
        mass = np.zeros((count, count))
        for place, entry in zip(direct.mass, entries[sample], strict=True):
            mass[place] = entry
        close(mass, upper + np.triu(upper, 1).T)
        if np.linalg.cond(mass) < 1e6:  # some random arms have joints that move nothing
            close(rising[sample], pin.aba(model, data, q, v, np.arange(1.0, count + 1)), np.linalg.cond(mass))


@pytest.mark.parametrize("spec", ARMS)
def test_geometry_is_that_of_pinocchio(spec: ArmSpec) -> None:
    pin, rng = pinocchio(), np.random.default_rng(6)
    motion = random_motion(spec, SAMPLES, rng)
    model = pinocchio_model(spec, random_parameters(spec, rng))
    data, graph = model.createData(), Graph()
    poses, motions = link_poses(graph, spec), link_motions(graph, spec)
    for joint in spec.joints:
        pose, rows = poses[joint.name], len(spec.moving)
        own = jacobian(graph, spec, motions[joint.name])
        based = jacobian(graph, spec, motions[joint.name], pose)
        tip = jacobian(graph, spec, motions[joint.name], pose, tuple(map(graph.constant, (1, -2, 3))))
        refs = [*chain.from_iterable([*pose.rotation, pose.origin, *own, *based, *tip])]
        found = sampled(graph, refs, motion, {})
        for sample in range(SAMPLES):
            q = state(spec, motion, sample)[0]
            frame = model.getFrameId(joint.name)
            pin.framesForwardKinematics(model, data, q)
            placed = data.oMf[frame]
            close(found[sample][:9].reshape(3, 3), placed.rotation)
            close(found[sample][9:12], placed.translation)
            local, aligned, at_tip = found[sample][12:].reshape(3, 6, rows)
            close(local, pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).reshape(6, rows))
            wanted = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED).reshape(6, rows)
            close(aligned, wanted)
            arm = placed.rotation @ np.array([1.0, -2.0, 3.0])
            close(at_tip[3:], wanted[3:])
            close(at_tip[:3], wanted[:3] + np.cross(wanted[3:].T, arm).T)


def close(found: np.ndarray, wanted: np.ndarray, condition: float = 1.0) -> None:
    scale = max(1.0, np.abs(wanted).max(initial=0.0))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * condition * scale)


@pytest.mark.parametrize("spec", [tx40(), *(random_arm(random.Random(s)) for s in range(50, 60))])
def test_torques_are_the_regressor_times_the_parameters(spec: ArmSpec) -> None:
    # with drives, couplings, asymmetric friction, links without mass and fixed ones
    rng = np.random.default_rng(7)
    rows, graph = arm_rows(spec), Graph()
    motion = random_motion(spec, 3, rng)
    values = dict(zip(rows.columns, rng.standard_normal(len(rows.columns)), strict=True))
    wanted = regressor_at(rows, motion, {}) @ [values[name] for name in rows.columns]
    torques = inverse_dynamics(rows.graph, spec)
    close(sampled(rows.graph, list(torques.values()), motion, values, rows.speeds), wanted)
    # the symbols of kept parameters stand for base parameters where the others are zero
    model = arm_base_model(rows)
    minimal = inverse_dynamics(rows.graph, spec, model.regrouped)
    base = {b.combination[0][0]: sum(f * values[n] for n, f in b.factors({}).items()) for b in model.base}
    close(sampled(rows.graph, list(minimal.values()), motion, base, rows.speeds), wanted)
    full, fewer = (rows.graph.operations(list(t.values())) for t in (torques, minimal))
    assert fewer <= full
    assert mass_matrix(graph, spec, inverse_dynamics(graph, spec)).keys() >= {
        (k, k) for k in range(len(spec.moving)) if spec.moving[k].link
    }


def test_base_parameters_save_a_tenth_of_the_operations() -> None:
    spec, graph = serial(ROBOTS["puma"]), Graph()
    model = arm_base_model(arm_rows(spec))
    full = graph.operations(list(inverse_dynamics(graph, spec).values()))
    assert graph.operations(list(inverse_dynamics(graph, spec, model.regrouped).values())) < 0.9 * full
