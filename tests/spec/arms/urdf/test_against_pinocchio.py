"""Placements, axes and inertials of URDFs against another library's reader: mass matrix and weight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.load import parse_arm
from tests.spec.arms.random_urdf import random_urdf
from tests.spec.arms.rigid_bodies import mass_matrix_and_weights


def arm_of(urdf: str, folder: Path) -> ArmSpec:
    (folder / "arm.urdf").write_text(urdf)
    return parse_arm('[arm]\nname = "a"\nurdf = "arm.urdf"\n', "a.toml", folder)


@pytest.mark.parametrize("seed", range(12))
def test_mass_matrix_and_weight_are_the_same(seed: int, tmp_path: Path) -> None:
    text = random_urdf(seed, joints=4 + seed % 5)
    arm = arm_of(text, tmp_path)
    theirs = pinocchio.buildModelFromXML(text)
    data = theirs.createData()
    rng = np.random.default_rng(seed)
    q = {joint.name: rng.uniform(-1.5, 1.5) for joint in arm.moving}
    position = pinocchio.neutral(theirs)
    places = []
    for name, value in q.items():
        joint = theirs.joints[theirs.getJointId(name)]
        places.append(joint.idx_v)
        position[joint.idx_q : joint.idx_q + joint.nq] = (
            [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        )
    assert len(places) == theirs.nv
    mass, weights = mass_matrix_and_weights(arm, q, arm.parameter_sets["urdf"])
    expected = pinocchio.crba(theirs, data, position)
    expected = np.triu(expected) + np.triu(expected, 1).T
    np.testing.assert_allclose(
        mass, expected[np.ix_(places, places)], rtol=0, atol=1e-12 * abs(expected).max()
    )
    held = pinocchio.computeGeneralizedGravity(theirs, data, position)[places]
    np.testing.assert_allclose(weights, held, rtol=0, atol=1e-12 * max(1.0, abs(held).max()))
