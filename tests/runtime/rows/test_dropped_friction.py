"""How the Coulomb friction enters a row that differentiates it: as a force on its body does."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.dropped_friction import dropped_friction, felt_forces
from tests.runtime.iv.physical.test_composite_iv import SCREW, model_of, motor_only

ONE_SENSOR = SCREW.split("[sensors.q_x]")[0] + '[sensors.q]\nq = { body = "BODY", measures = "position" }\n'
THREE = """
chain = { name = "three", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "c", inertia = "J_c", viscous = "F_vc", coulomb = "F_sc" },
    { name = "l", inertia = "J_l", viscous = "F_vl", coulomb = "F_sl" },
]
links = [
    { bodies = ["m", "c"], stiffness = "K_1", damping = "D_1" },
    { bodies = ["c", "l"], stiffness = "K_2", damping = "D_2" },
]

[sensors.ends]
q_m = { body = "m", measures = "position" }
q_l = { body = "l", measures = "position" }
"""


def three() -> Model:
    return model_of(THREE, "ends")


def test_friction_takes_the_terms_of_the_force_on_its_body() -> None:
    model = motor_only("emps300")
    (found,) = dropped_friction(model, 0)
    assert (found.body, found.friction) == ("m", "F_sm")
    assert [model.base_parameters[column] for column in found.columns] == ["F_sm"]
    values = {name: 1.0 + 0.3 * place for place, name in enumerate(model.parameters)}
    base = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    (shares,) = felt_forces(model, values)
    # Gamma = ... + F_s (s + F_vmc/K s' + J_c/K s''), as the force has minus signs in its columns
    at_motor = np.max(np.abs(shares), axis=0).argmax()
    np.testing.assert_allclose(shares[:3, at_motor], [1.0, base["F_vmc/K"], base["J_c/K"]], rtol=1e-9)


def test_friction_of_any_body_takes_what_elimination_leaves_of_its_force() -> None:
    model, rng = three(), np.random.default_rng(3)
    values = {name: float(rng.uniform(0.5, 2.0)) for name in model.parameters}
    first, second = felt_forces(model, values)
    v = values
    # (K_1 + D_1 s) is what the force on c has in the row of m and c, over that of the force on m at rest
    np.testing.assert_allclose(second[:2, 1] * (v["K_1"] + v["K_2"]), [v["K_1"], v["D_1"]], rtol=1e-9)
    np.testing.assert_allclose(
        second[:3, 0] * (v["K_1"] + v["K_2"]),
        [v["K_1"] + v["K_2"], v["F_vc"] + v["D_1"] + v["D_2"], v["J_c"]],
        rtol=1e-9,
    )
    # c is eliminated by the balance of l, which has nothing of a force on c
    np.testing.assert_allclose(first[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(first[:2, 2] * v["K_2"], [-v["K_1"], -v["D_1"]], rtol=1e-9)


def test_forces_are_felt_alike_where_friction_depends_on_the_direction() -> None:
    both = THREE.replace('coulomb = "F_sm", ', 'coulomb = "F_sm", friction = "asymmetric", ')
    values = {name: 1.0 + 0.3 * place for place, name in enumerate(three().parameters)}
    halves = {f"{name}_{side}": values[name] for name in ("F_vm", "F_sm") for side in ("plus", "minus")}
    found = felt_forces(model_of(both, "ends"), values | halves)
    for one, other in zip(found, felt_forces(three(), values), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_the_friction_of_a_body_without_a_sensor_takes_a_direction_that_is_brought() -> None:
    ends, middle = (dropped_friction(three(), row) for row in range(2))
    assert [(one.body, one.key) for one in ends] == [("m", "d1_q_m"), ("l", "d1_q_l")]
    assert [(one.body, one.key) for one in middle] == [("m", "d1_q_m"), ("c", "sign_c")]


@pytest.mark.parametrize("sensor", ["m", "c"])
def test_none_where_it_is_not_known_how_it_enters(sensor: str) -> None:
    model = model_of(ONE_SENSOR.replace("BODY", sensor), "q")
    # the motor's friction is in the row of its own encoder; the carriage's encoder does not see its direction
    (found,) = dropped_friction(model, 0)
    assert found.key.startswith("sign_") == (sensor == "c")
    if sensor == "m":
        # a friction that is known is in no column
        assert dropped_friction(with_known(model, {"Fsm": 0.2}), 0) == ()
