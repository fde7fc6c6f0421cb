"""Forces of links from their placements are those of the rows of modules."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.simulation.arms.placed_links import placed_links
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import SPATIAL, elastic
from tests.symbolic.arms.made_arms import SCARA, arm, dh, joint, serial

ACROSS = (Fraction(1), Fraction(2), Fraction(-9))
TREE = arm(
    [
        joint("1", None, dh(0, 0, 0, 0), drive=True),
        joint("2", "1", dh(-90, 0, 0, Fraction(1, 5)), "prismatic", drive=True),
        joint("3", "2", dh(90, Fraction(1, 4), 30, 0), "fixed"),
        joint("4", "3", dh(0, Fraction(1, 3), 0, 0), drive=True),
        joint("5", "1", dh(90, Fraction(1, 2), 0, 0), drive=True),
    ],
    ACROSS,
)


@pytest.mark.parametrize("spec", [serial(SPATIAL, drive=True), serial(SCARA, drive=True), TREE])
def test_forces_are_those_of_the_rows_of_links(spec: ArmSpec) -> None:
    spec = elastic(spec)
    text = arm_module(arm_base_model(arm_rows(spec, sensor_set="encoders")))
    model = model_from_text(text, "elastic")
    placed, rng = placed_links(model.module), np.random.default_rng(1)
    assert placed is not None
    values = {name: float(rng.uniform(0.2, 1.0)) for name in model.parameters}
    links = {name: value for name, value in values.items() if model.roles[name].role == "link"}
    alone = {**dict.fromkeys(model.parameters, 0.0), **links}
    moving = [one.name for one in spec.moving]
    motion = rng.uniform(-2.0, 2.0, (3, len(moving), 20))
    read = {one.joint: one.key for one in spec.sensor_sets["encoders"] if one.side == "link"}
    signals = dict.fromkeys(model.module.SIGNALS, np.zeros(20))
    for order, lines in zip(("", "d1_", "d2_"), motion, strict=True):
        for name, line in zip(moving, lines, strict=True):
            signals[order + read[name]] = line
    needed = model.module.regressor(signals) @ model.base_from_physical(alone)
    rows = [model.module.ROWS.index(f"{name} link") for name in moving]
    found = placed.forces(placed.links(values), motion)
    assert found == pytest.approx(needed[:, rows].T, rel=1e-11, abs=1e-11)


def test_rigid_arms_list_no_placements() -> None:
    spec = serial(SPATIAL, drive=True)
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec))), "rigid")
    assert placed_links(model.module) is None
