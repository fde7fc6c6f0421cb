from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.symbolic.arms.arm_rows import LARGEST_ARM, ArmRows, arm_rows
from tests.symbolic.arms.made_arms import PUMA, ROBOTS, STANFORD, arm, joint, random_arm, serial, tx40
from tests.symbolic.arms.pinocchio_arms import (
    ORDER,
    pinocchio,
    pinocchio_model,
    random_motion,
    random_parameters,
    state,
)
from tests.symbolic.arms.regressor_samples import regressor_at

ARMS = [serial(rows) for rows in ROBOTS.values()]
#: arms with every kind of joint, trees among them
RANDOM = [random_arm(random.Random(seed), fixed=0) for seed in range(10)]


@pytest.mark.parametrize("spec", [*ARMS, *RANDOM])
def test_regressor_is_that_of_pinocchio(spec: ArmSpec) -> None:
    pin = pinocchio()
    rng = np.random.default_rng(1)
    model = pinocchio_model(spec, random_parameters(spec, rng))
    data, rows, motion = model.createData(), arm_rows(spec), random_motion(spec, 3, rng)
    ours = regressor_at(rows, motion, {})
    for sample in range(3):
        theirs = pin.computeJointTorqueRegressor(model, data, *state(spec, motion, sample))
        theirs = theirs.reshape(model.nv, -1)  # that of one joint has one axis only
        for body, link in enumerate(j.link for j in spec.joints):
            if link:
                places = [rows.columns.index(link[LINK_PARAMETERS.index(kind)]) for kind in ORDER]
                wanted = theirs[:, 10 * body : 10 * body + 10]
                np.testing.assert_allclose(ours[sample][:, places], wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_fixed_links_move_with_the_body_that_carries_them(seed: int) -> None:
    pin = pinocchio()
    spec, rng = random_arm(random.Random(100 + seed), fixed=0.5), np.random.default_rng(seed)
    values = random_parameters(spec, rng)
    model, rows = pinocchio_model(spec, values), arm_rows(spec)
    motion = random_motion(spec, 1, rng)
    ours = regressor_at(rows, motion, {})[0] @ [values.get(name, 0.0) for name in rows.columns]
    theirs = pin.rnea(model, model.createData(), *state(spec, motion, 0))
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12 * max(1, np.abs(theirs).max()))


def drive_matrix(rows: ArmRows, motion: dict[tuple[str, int], np.ndarray]) -> dict[str, np.ndarray]:
    regressor = regressor_at(rows, motion, {})
    return {name: regressor[:, :, k] for k, name in enumerate(rows.columns)}


def test_drives_act_on_their_joint_and_coupled_motors_on_all_they_move() -> None:
    spec, rng = tx40(), np.random.default_rng(2)
    motion = random_motion(spec, 5, rng)
    columns = drive_matrix(arm_rows(spec), motion)
    fifth, sixth = (motion["5", order] for order in (1, 2)), (motion["6", order] for order in (1, 2))
    (v5, a5), (v6, a6) = fifth, sixth
    zero = np.zeros(5)
    for name, five, six in [
        ("Ia5", a5, zero), ("fv5", v5, zero), ("fs5", np.sign(v5), zero), ("off5", zero + 1, zero),
        ("Ia6_motor", a5 + a6, a5 + a6), ("fv6_motor", v5 + v6, v5 + v6),
        ("fs6_motor", np.sign(v5 + v6), np.sign(v5 + v6)), ("fs6", zero, np.sign(v6)),
    ]:  # fmt: skip
        wanted = np.column_stack([zero, zero, zero, zero, five, six])
        np.testing.assert_allclose(columns[name], wanted, rtol=1e-14, atol=1e-14, err_msg=name)
    assert "off6_motor" not in columns and "Ia5_motor" not in columns


def test_asymmetric_friction_has_a_column_for_each_direction() -> None:
    spec = arm([joint("1", None, (), drive=True, friction="asymmetric")])
    motion = {("1", 0): np.zeros(2), ("1", 1): np.array([2.0, -3.0]), ("1", 2): np.zeros(2)}
    columns = drive_matrix(arm_rows(spec), motion)
    found = {name: column[:, 0].tolist() for name, column in columns.items() if name.startswith("f")}
    assert found == {"fv1_plus": [2, 0], "fv1_minus": [0, -3], "fs1_plus": [1, 0], "fs1_minus": [0, -1]}


@pytest.mark.parametrize("seed", range(5))
def test_rows_of_motors_are_those_of_joints_before_the_transmission(seed: int) -> None:
    rng = random.Random(seed)
    spec = random_arm(rng, joints=3)
    matrix = [[Fraction(rng.randint(-2, 2)) for _ in range(3)] for _ in range(3)]
    for k in range(3):
        matrix[k][k] = Fraction(30 + k)
    spec = replace(spec, transmission=tuple(map(tuple, matrix)))
    joints, motors = arm_rows(spec), arm_rows(spec, "motor")
    assert joints.columns == motors.columns
    motion = random_motion(spec, 4, np.random.default_rng(seed))
    torque = np.einsum("km,tmc->tkc", np.array(matrix, dtype=float).T, regressor_at(motors, motion, {}))
    np.testing.assert_allclose(torque, regressor_at(joints, motion, {}), rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("seed", range(8))
def test_rows_of_the_base_are_the_force_and_torque_that_hold_it(seed: int) -> None:
    pin = pinocchio()
    spec, rng = random_arm(random.Random(200 + seed), fixed=0.2), np.random.default_rng(seed)
    values = random_parameters(spec, rng)
    model, rows = pinocchio_model(spec, values), arm_rows(spec, base_rows=True)
    motion = random_motion(spec, 1, rng)
    ours = regressor_at(rows, motion, {})[0] @ [values.get(name, 0.0) for name in rows.columns]
    data = model.createData()
    pin.rnea(model, data, *state(spec, motion, 0))
    pin.forwardKinematics(model, data, state(spec, motion, 0)[0])
    # what is fixed to the base belongs to no joint of pinocchio's
    held = np.zeros(6)
    for body in range(1, model.njoints):
        if model.parents[body] == 0:
            held += data.oMi[body].act(data.f[body]).vector
    only = {j.name for j in spec.joints if model.frames[model.getFrameId(j.name)].parentJoint == 0}
    for number, name in enumerate(rows.columns):
        if any(name in j.link for j in spec.joints if j.name in only):
            ours = ours - values[name] * regressor_at(rows, motion, {})[0][:, number]
    np.testing.assert_allclose(ours[len(spec.moving) :], held, rtol=1e-11, atol=1e-11)


def test_mistakes_are_explained() -> None:
    with pytest.raises(ModelError, match="no joint moves"):
        arm_rows(arm([joint("1", None, (), "fixed")]))
    with pytest.raises(ModelError, match="depend on each other"):
        arm_rows(replace(serial(STANFORD[:2]), transmission=((Fraction(1),) * 2,) * 2))
    with pytest.raises(ModelError, match=f"at most {LARGEST_ARM}"):
        arm_rows(serial([(90, 0, 0, 0)] * (LARGEST_ARM + 1)))


def test_a_six_axis_arm_costs_fewer_than_a_thousand_operations() -> None:
    rows = arm_rows(serial(PUMA))
    assert rows.graph.operations(list(rows.entries.values())) < 1000
