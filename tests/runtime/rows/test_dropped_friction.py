"""How the Coulomb friction enters a row that differentiates it: read off the force on the same body."""

from __future__ import annotations

import pytest

from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.rows.dropped_friction import dropped_friction
from tests.runtime.iv.physical.test_composite_iv import SCREW, model_of, motor_only

ONE_SENSOR = SCREW.split("[sensors.q_x]")[0] + '[sensors.q]\nq = { body = "BODY", measures = "position" }\n'


def test_friction_takes_the_terms_of_the_force_on_its_body() -> None:
    model = motor_only("emps300")
    (found,) = dropped_friction(model, 0)
    assert found.body == "m"
    assert model.base_parameters[found.column] == "F_sm"
    names = {order: column for _, order, column in found.terms}
    assert sorted(found.orders) == [0, 1, 2]
    assert names[0] is None
    assert (model.base_parameters[names[1] or 0], model.base_parameters[names[2] or 0]) == (
        "F_vmc/K",
        "J_c/K",
    )
    # Gamma = ... + F_s (s + F_vmc/K s' + J_c/K s''), as the force has minus signs in its columns
    assert {coefficient for coefficient, _, _ in found.terms} == {1.0}


@pytest.mark.parametrize("sensor", ["m", "c"])
def test_none_where_it_is_not_known_how_it_enters(sensor: str) -> None:
    model = model_of(ONE_SENSOR.replace("BODY", sensor), "q")
    # the motor's friction is in the row of its own encoder; the carriage's encoder does not see its direction
    assert bool(dropped_friction(model, 0)) == (sensor == "m")
    if sensor == "m":
        # a friction that is known is in no column
        assert dropped_friction(with_known(model, {"Fsm": 0.2}), 0) == ()
