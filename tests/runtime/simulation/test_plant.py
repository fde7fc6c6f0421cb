"""A plant is a model with parameter values that make sense, in the order of the state."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_asymmetric_qm, tree_mixed
from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.simulation.plant import felt_accelerations, make_plant
from modelgen.spec.load import parse_spec

EMPS = model_from_module(emps300_qm_qc)
TABLE_2 = EMPS.parameter_sets["table_2"]
TREE = model_from_module(tree_mixed)

SHARED = """
[chain]
name = "shared"
motion = "translation"
[[bodies]]
name = "a"
inertia = "M_1"
actuator = "F"
[[bodies]]
name = "b"
inertia = "M_2"
coulomb = "F_s"
[[bodies]]
name = "c"
inertia = "M_1"
[[links]]
bodies = ["a", "b"]
stiffness = "K"
{stiffness3}
[[links]]
bodies = ["b", "c"]
stiffness = "K"
[known]
M_2 = 5.0
[sensors.all]
q_a = {{ body = "a", measures = "position" }}
q_b = {{ body = "b", measures = "position" }}
q_c = {{ body = "c", measures = "position" }}
"""


def shared(stiffness3: str = "") -> Model:
    return model_from_text(generate(parse_spec(SHARED.format(stiffness3=stiffness3), "shared.toml"), "all"))


def complaints(model: Model, parameters: dict[str, float], actuator: str | None = None) -> list[str]:
    with pytest.raises(DataError) as caught:
        make_plant(model, parameters, actuator)
    return [str(problem) for problem in caught.value.problems]


def test_bodies_and_inertias_are_in_the_order_of_the_state() -> None:
    plant = make_plant(TREE, TREE.parameter_sets["nominal"])
    assert plant.bodies == ("m", "g", "a", "b")
    np.testing.assert_array_equal(plant.inertia, [2e-4, 0.02, 0.05, 0.03])
    assert (plant.actuator, plant.driven) == (0, 0)


def test_an_inertia_may_be_shared_and_known() -> None:
    plant = make_plant(shared(), {"M_1": 2.0, "K": 0.0, "F_s": 1.0})
    assert plant.bodies == ("a", "b", "c")
    np.testing.assert_array_equal(plant.inertia, [2.0, 5.0, 2.0])
    assert plant.parameters["M_2"] == 5.0


def test_a_given_value_goes_before_a_known_one() -> None:
    plant = make_plant(shared(), {"M_1": 2.0, "K": 1.0, "F_s": 1.0, "M_2": 3.0})
    np.testing.assert_array_equal(plant.inertia, [2.0, 3.0, 2.0])


def test_the_actuator_can_be_chosen() -> None:
    plant = make_plant(TREE, TREE.parameter_sets["nominal"], "Gamma_b")
    assert (plant.actuator, plant.bodies[plant.driven]) == (1, "b")
    assert complaints(TREE, dict(TREE.parameter_sets["nominal"]), "Gamma_c") == [
        "actuator: there is no 'Gamma_c'; choose one of Gamma_m, Gamma_b"
    ]


def test_only_bodies_with_coulomb_friction_stick() -> None:
    plant = make_plant(TREE, TREE.parameter_sets["nominal"])
    assert [body.velocity for body in plant.coulomb_bodies] == [4, 6]
    np.testing.assert_array_equal(plant.offsets, [0.0, 1.5])
    assert make_plant(EMPS, {**TABLE_2, "F_sm": 0.0}).coulomb_bodies == ()


def test_friction_that_depends_on_direction() -> None:
    model = model_from_module(emps_rigid_asymmetric_qm)
    values = {name: 1.0 + i for i, name in enumerate(model.parameters)}
    plant = make_plant(model, values)
    (body,) = plant.coulomb_bodies
    entry = model.friction[0]
    assert (body.plus, body.minus) == (values[entry.coulomb_plus or ""], values[entry.coulomb_minus or ""])
    assert body.plus != body.minus
    viscous = [-values["Fv_plus"] / values["M"], -values["Fv_minus"] / values["M"]]
    assert [plant.space((sign,)).A[1, 1] for sign in (1, -1)] == viscous


def test_every_wrong_parameter_is_named_at_once() -> None:
    wrong = {"J_m": 0.0, "F_vm": float("nan"), "F_sm": -1.0, "J_c": -2.0, "K": "stiff"}
    assert complaints(EMPS, wrong) == [  # type: ignore[arg-type]
        "parameters: J_m: is 0.0 kg m^2; an inertia must be positive",
        "parameters: F_vm: is nan; give a finite number in N m s/rad; "
        "give zero or a magnitude from 1e-30 to 1e+30; check the unit",
        "parameters: F_sm: is -1.0 N m; a friction force must be zero or positive",
        "parameters: J_c: is -2.0 kg m^2; an inertia must be positive",
        "parameters: F_vmc: is missing; give its value in N m s/rad",
        "parameters: K: is 'stiff'; give a finite number in N m/rad; "
        "give zero or a magnitude from 1e-30 to 1e+30; check the unit",
    ]


def test_parameters_are_copied() -> None:
    given = dict(TABLE_2)
    plant = make_plant(EMPS, given)
    given["K"] = 0.0
    assert plant.parameters["K"] == TABLE_2["K"]
    assert isinstance(plant.parameters, MappingProxyType)


def test_a_cubic_stiffness_pulls_both_ends() -> None:
    plant = make_plant(shared('stiffness3 = "K_3"'), {"M_1": 2.0, "K": 1.0, "F_s": 1.0, "K_3": 6.0})
    (spring,) = plant.cubic_forces(lags=1)
    np.testing.assert_array_equal(spring.deflection, [1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(spring.push, [0.0, 0.0, 0.0, -3.0, 6.0 / 5.0, 0.0, 0.0], rtol=1e-15)
    # nothing here reads an acceleration
    np.testing.assert_array_equal(felt_accelerations(plant.model), np.zeros((3, 3)))


def test_a_chain_without_actuator_is_refused() -> None:
    (problem,) = complaints(replace(EMPS, actuators=()), dict(TABLE_2))
    assert problem == (
        "model emps300: has no actuator, so nothing can drive it; give a body an actuator in the spec"
    )
