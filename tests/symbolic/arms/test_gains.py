"""Drives whose gain is a parameter: their signal is a column, and a known payload gives the scale."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import RowKind, arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.made_arms import random_arm, serial, tx40
from tests.symbolic.arms.numerical_rank import numerical_rank
from tests.symbolic.arms.pinocchio_arms import random_motion
from tests.symbolic.arms.regressor_samples import regressor_at


def with_gains(spec: ArmSpec, joints: tuple[str, ...] | None = None) -> ArmSpec:
    chosen = [joint.name for joint in spec.moving] if joints is None else joints
    found = (replace(j, gain=f"gain_{j.name}") if j.name in chosen else j for j in spec.joints)
    return replace(spec, joints=tuple(found))


def coupled(spec: ArmSpec, rng: random.Random) -> ArmSpec:
    count = range(len(spec.moving))
    matrix = [[Fraction(rng.choice([0, 0, 0, 2]) if i != k else 20 + k) for i in count] for k in count]
    return replace(spec, transmission=tuple(map(tuple, matrix)))


ARMS = [tx40(), *(coupled(random_arm(random.Random(seed)), random.Random(seed)) for seed in range(3))]


@pytest.mark.parametrize("kind", ["joint", "motor"])
@pytest.mark.parametrize("spec", ARMS)
def test_gain_times_signal_is_the_force_of_the_drive_on_its_own_joint(spec: ArmSpec, kind: RowKind) -> None:
    plain, rng = arm_rows(spec, kind), np.random.default_rng(4)
    names = [joint.name for joint in spec.moving]
    of_gain = tuple(names[::2])
    rows = arm_rows(with_gains(spec, of_gain), kind)
    motion = random_motion(spec, 4, rng)
    values = rng.standard_normal(len(plain.columns))
    torques = regressor_at(plain, motion, {}) @ values
    if kind == "joint":
        torques = np.linalg.solve(np.array(spec.transmission, dtype=float).T, torques.T).T
    gains = {f"gain_{name}": 2.0 + k for k, name in enumerate(of_gain)}
    forces = {}
    for place, name in enumerate(names):
        ratios = spec.transmission[place]
        own = float(ratios[place] or next(ratio for ratio in ratios if ratio))
        scale = own / gains[f"gain_{name}"] if name in of_gain else 1.0
        forces[f"force {name}"] = torques[:, place] * scale
    by_name = {**dict(zip(plain.columns, values, strict=True)), **gains}
    found = regressor_at(rows, motion, forces) @ [by_name[name] for name in rows.columns]
    left = regressor_at(plain, motion, {}) @ values - found  # what measured torques are left with
    for place, name in enumerate(names):
        if name in of_gain and kind == "motor":
            np.testing.assert_allclose(found[:, place], 0.0, atol=1e-9 * np.abs(torques).max() + 1e-12)
    shares = np.array(spec.transmission, dtype=float).T if kind == "joint" else np.eye(len(names))
    alone = [0.0 if name in of_gain else 1.0 for name in names]
    measured = (torques * alone) @ shares.T
    np.testing.assert_allclose(found, measured, atol=1e-9 * max(1.0, np.abs(left).max()))


@pytest.mark.parametrize("spec", ARMS)
def test_every_gain_is_a_base_parameter_of_its_own(spec: ArmSpec) -> None:
    plain, rows = arm_base_model(arm_rows(spec)), arm_rows(with_gains(spec))
    model = arm_base_model(rows)
    gains = {f"gain_{joint.name}" for joint in spec.moving}
    assert gains <= set(model.identifiable)
    assert {b.name for b in model.base} - gains == {b.name for b in plain.base}
    assert numerical_rank(rows) == len(model.base)


def test_a_known_payload_or_a_measured_torque_gives_the_scale() -> None:
    spec = with_gains(serial([(0, 0, 0, 0), (-90, 0, 0, 0.2)], True))
    assert not arm_rows(spec).has_scale
    assert not arm_rows(replace(spec, known={"m2": 0.0})).has_scale
    assert arm_rows(replace(spec, known={"m2": 1.5})).has_scale
    assert arm_rows(replace(spec, known={"gain_1": 1.5})).has_scale
    bare = serial([(0, 0, 0, 0), (-90, 0, 0, 0.2)], True)
    assert arm_rows(with_gains(bare, ("1",))).has_scale
