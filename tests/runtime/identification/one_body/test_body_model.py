"""A chain as one body responds as the chain does far below its modes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from modelgen.runtime.identification.one_body.body_model import as_one_body
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.model.model import Model
from tests.runtime.iv.physical.swinging_servo import SERVO, TRUTH, servo
from tests.runtime.iv.physical.test_composite_iv import model_of

GEARED = SERVO.replace('damping = "D" }', 'damping = "D", ratio = 4 }')
FASTER = SERVO.replace('measures = "position"', 'measures = "velocity"')
THREE = SERVO.replace(
    '{ name = "l", inertia = "J_l" },', '{ name = "l", inertia = "J_l" }, { name = "x", inertia = "J_x" },'
).replace('damping = "D" }]', 'damping = "D" }, { bodies = ["l", "x"], stiffness = "K_x", damping = "D_x" }]')
VALUES = {**TRUTH, "J_x": 3e-3, "K_x": 80.0, "D_x": 0.03}


def force_per_position(model: Model, values: dict[str, float], w: float) -> complex:
    """Return the force of the whole chain per reading, at w in rad/s, without Coulomb friction."""
    space = model.state_space({name: values[name] for name in model.parameters}, {})
    states = np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B)
    return complex(1.0 / (space.C @ states + space.D)[0, 0])


def as_rows_say(model: Model, values: dict[str, float], w: float) -> complex:
    """Return the same of rows that hold the force alone: a sum of powers of j w."""
    derivatives = {one.key: one.derivative for one in model.signals}
    return sum(
        values[model.base_parameters[column]] * factor * (1j * w) ** derivatives[key]
        for column, terms in model.regressor_columns[0].items()
        for factor, key in terms
        if not key.startswith("sign")
    )


def sums(inertia: float, bending: float, model: Model) -> dict[str, float]:
    found = {"inertia": inertia, BENDING: bending, "viscous": TRUTH["F_vm"], "coulomb": TRUTH["F_sm"]}
    return {name: found[model.roles[name].role] for name in model.parameters}


@pytest.mark.parametrize(
    ("text", "share", "inertia", "bending"),
    [
        (SERVO, 1.0, 9e-3, 5e-3**2 / 44.0),
        (FASTER, 1.0, 9e-3, 5e-3**2 / 44.0),
        (GEARED, 1.0 / 16.0, 4e-3 + 5e-3 / 16.0, 5e-3**2 / 44.0 / 16.0),
        (THREE, 1.0, 12e-3, 8e-3**2 / 44.0 + 3e-3**2 / 80.0),
    ],
)
def test_the_response_is_that_of_the_chain_up_to_the_fourth_power(
    text: str, share: float, inertia: float, bending: float
) -> None:
    whole = model_of(text, "motor")
    body = as_one_body(whole)
    assert body is not None
    values = sums(inertia, bending, body)
    apart = [abs(force_per_position(whole, VALUES, w) - as_rows_say(body, values, w)) for w in (0.25, 0.5)]
    # damping is what is left: one power more of the frequency, one less where speeds are read
    power = 5 - whole.sensors[0].order
    assert np.log2(apart[1] / apart[0]) == pytest.approx(power, abs=0.3)
    # and the bending is seen
    values = sums(inertia, 0.0, body)
    assert abs(force_per_position(whole, VALUES, 0.5) - as_rows_say(body, values, 0.5)) > 5.0 * apart[1]


def test_it_moves_as_the_chain_does_slowly() -> None:
    body = as_one_body(servo())
    assert body is not None
    assert body.parameters == ("J_m + J_l", "F_vm", "F_sm", "J_l^2/K")
    space = body.state_space(sums(9e-3, 1e-7, body), {})
    np.testing.assert_allclose(space.A, [[0.0, 1.0], [0.0, -2e-3 / 9e-3]])
    np.testing.assert_allclose([space.B[1, 0], space.E[1, 0]], [1.0 / 9e-3, -1.0 / 9e-3])
    np.testing.assert_array_equal(space.C, [[1.0, 0.0]])


def test_chains_that_more_is_known_of_are_left_alone() -> None:
    both = SERVO + 'q_l = { body = "l", measures = "position" }\n'
    assert as_one_body(model_of(both, "motor")) is None
    # a spring to the ground holds the body, however slow it moves
    ground = SERVO.replace(
        "links = [", 'links = [{ bodies = ["l", "ground"], stiffness = "K_g", damping = "D_g" }, '
    )
    assert as_one_body(model_of(ground, "motor")) is None
    assert as_one_body(with_known(servo(), {"K": 44.0})) is None


def test_it_is_made_again_where_it_is_unpickled() -> None:
    body = as_one_body(servo())
    assert body is not None
    again = pickle.loads(pickle.dumps(body))
    assert again.parameters == body.parameters
    np.testing.assert_array_equal(again.base_jacobian(sums(1.0, 1.0, body)), np.eye(4))
