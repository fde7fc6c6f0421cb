"""The controller closes around the motor's own coordinate, slow against the elasticity."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_qm, tree_mixed
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import (
    PositionVelocityController,
    bandwidth_hz,
    closed_loop,
    default_controller,
    vibration,
)
from modelgen.runtime.simulation.plant import make_plant

EMPS = model_from_module(emps300_qm_qc)
RIGID = model_from_module(emps_rigid_qm)
TREE = model_from_module(tree_mixed)
FREE_TREE = {**TREE.parameter_sets["nominal"], "K_b": 0.0}


def test_frequencies_are_those_of_the_paper() -> None:
    for values, frequency_hz in (("table_1", 106.5), ("table_2", 123.6)):
        modes = vibration(make_plant(EMPS, EMPS.parameter_sets[values]))
        assert modes.frequencies_hz == pytest.approx([0.0, frequency_hz], abs=0.06)
        assert bandwidth_hz(modes) == pytest.approx(frequency_hz / 5.0, abs=0.02)


def test_gears_reflect_inertias_and_motions_to_the_actuator() -> None:
    p = FREE_TREE
    modes = vibration(make_plant(TREE, p))
    assert modes.frequencies_hz[0] == 0.0
    assert modes.drive_inertia == pytest.approx(p["J_m"] + (p["J_g"] + p["J_a"] + p["J_b"]) / 20.0**2)
    assert modes.lowest == pytest.approx([1.0, 0.05, 0.05, 0.05], rel=1e-6)
    assert modes.compliance == np.inf


def test_a_grounded_chain_has_a_static_compliance() -> None:
    plant = make_plant(TREE, TREE.parameter_sets["nominal"])
    A, B = plant.space((1, 1)).A, plant.space((1, 1)).B
    static = np.linalg.solve(-A[4:, :4], B[4:, 0])
    assert vibration(plant).compliance == pytest.approx(static[0])


def test_the_default_loop_has_its_bandwidth_and_damping() -> None:
    plant = make_plant(RIGID, {"M": 95.0, "Fv": 0.0, "Fc": 0.0, "offset": 0.0})
    poles = np.linalg.eigvals(closed_loop(plant, default_controller(plant)).matrix(()))
    assert np.abs(poles) == pytest.approx([2.0 * pi * 5.0] * 2)
    assert -poles.real / np.abs(poles) == pytest.approx([0.7] * 2)


@pytest.mark.parametrize("values", ["table_1", "table_2", "light"])
def test_the_default_loop_is_stable_and_leaves_the_elastic_mode_alone(values: str) -> None:
    plant = make_plant(EMPS, EMPS.parameter_sets[values])
    poles = np.linalg.eigvals(closed_loop(plant, default_controller(plant)).matrix((1,)))
    assert poles.real.max() < -20.0
    elastic_hz = np.abs(poles[np.abs(poles.imag) > 400.0]) / (2.0 * pi)
    assert elastic_hz == pytest.approx(vibration(plant).elastic_hz[0], rel=0.05)


def test_the_loop_feeds_back_the_driven_body_only() -> None:
    plant = make_plant(TREE, TREE.parameter_sets["nominal"], "Gamma_b")
    space = plant.space((0, 0))
    system = closed_loop(plant, PositionVelocityController(kp=3.0, kv=2.0))
    change = system.matrix((0, 0)) - space.A
    J_b = plant.parameters["J_b"]
    assert change[7, 3] == pytest.approx(-3.0 / J_b)
    assert change[7, 7] == pytest.approx(-2.0 / J_b)
    assert np.count_nonzero(change) == 2
    np.testing.assert_array_equal(system.B[:, 0], space.B[:, 1])
    # the arm's offset acts as a constant acceleration
    np.testing.assert_allclose(system.drift, [0, 0, 0, 0, 0, 0, -1.5 / 0.05, 0])


def test_gains_must_be_numbers() -> None:
    with pytest.raises(DataError, match="controller: kv: is nan; give a finite number"):
        PositionVelocityController(1.0, float("nan"))
