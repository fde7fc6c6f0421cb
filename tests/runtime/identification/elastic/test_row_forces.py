"""Friction behind springs, springs that stiffen, and play are named, and the intervals hold them."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen import Record, identify
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.elastic.row_forces import force_rows, row_forces, summed_friction
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.rows.record_rows import unmasked_rows
from tests.runtime.identification.elastic.test_channels_set_right import FS, errors, exact, made, noisy, told


def test_forces_are_those_of_rows_that_hold_links_and_springs() -> None:
    forces = {force.name: force for force in row_forces(made()[0])}
    assert forces["viscous friction at link 1"].acts == {"1 link": 1.0}
    assert forces["cube of spring 2"].acts == {"2 spring": 1.0, "2 link": -1.0}
    assert not summed_friction(made()[0])


def test_what_motors_alone_say_of_friction_is_labelled_as_a_sum() -> None:
    # without an encoder on the link nothing tells it from friction of the motor
    model = made(("motor",))[0]
    assert not tuple(row_forces(model))
    (note,) = summed_friction(model)
    assert note.startswith("friction behind the springs of joints 1, 2,")
    assert note.endswith("if there is any, the value is the sum")


Channels = dict[str, np.ndarray]


def deflected(channels: Channels, truth: dict[str, float], torque: np.ndarray) -> Channels:
    """Return channels of an arm whose first spring holds a further torque, (n,): its motor is ahead."""
    more = torque / truth["K1"]
    speed = np.gradient(more, 1.0 / FS)
    force = torque + truth["Ia1"] * np.gradient(speed, 1.0 / FS) + truth["fv1"] * speed
    ahead = channels["motor_position_1"] + more
    return channels | {"motor_position_1": ahead, "tau_1": channels["tau_1"] + force}


def test_friction_behind_a_spring_is_named_and_held() -> None:
    model, channels, truth = exact(gears=False)
    friction = 2.0 * np.gradient(channels["link_position_1"], 1.0 / FS)
    estimate = identify(model, Record(noisy(deflected(channels, truth, friction), 1.0), FS, "arm"))
    assert any("viscous friction at link 1, behind the spring" in said for said in told(estimate))
    assert np.max(np.abs(errors(estimate, truth))) < 3.5


def test_a_spring_that_stiffens_is_named_and_held() -> None:
    model, channels, truth = exact(gears=False)
    K = truth["K1"]
    torque = K * (channels["motor_position_1"] - channels["link_position_1"])
    cubic = 0.2 * K**3 / np.max(np.abs(torque)) ** 2
    deflection = torque / K
    for _ in range(10):
        left = K * deflection + cubic * deflection**3 - torque
        deflection = deflection - left / (K + 3.0 * cubic * deflection**2)
    changed = deflected(channels, truth, K * deflection - torque)
    # the torque is the link's as before
    changed["tau_1"] = changed["tau_1"] - (K * deflection - torque)
    estimate = identify(model, Record(noisy(changed, 1.0), FS, "arm"))
    assert any("the spring of joint 1 stiffens" in said for said in told(estimate))
    assert np.max(np.abs(errors(estimate, truth))) < 3.5


def test_a_force_passes_as_a_measured_one_does() -> None:
    model, read, _ = made()
    (record,) = with_derived(model, [Record(read, FS, "arm")])
    choice = choose_filter(model, [record])
    (force,) = (one for one in row_forces(model) if one.name == "viscous friction at link 1")
    plain = unmasked_rows(model, record, choice, choice.decimation[0], 0)
    rows = force_rows(force, plain, record, choice)
    names = [row.name for row in model.rows]
    speed = np.gradient(read["link_position_1"], 1.0 / FS)
    own = rows[names.index("1 link")]
    assert np.std(own) == pytest.approx(np.std(speed), rel=0.05)
    assert not rows[names.index("1 spring")].any()
