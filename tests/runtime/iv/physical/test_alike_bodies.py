"""Branches that only the motor's encoder tells of: which may be exchanged, and what becomes of them."""

from __future__ import annotations

import pytest

from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.physical.alike_bodies import exchanges
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

STAR = """
[chain]
name = "star"
motion = "rotation"

[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
actuator = "T"

[[bodies]]
name = "g"
inertia = "J_g"

[[bodies]]
name = "c"
inertia = "J_c"

[[links]]
bodies = ["m", "g"]
stiffness = "K_g"
damping = "D_g"

[[links]]
bodies = ["{hook}", "c"]
stiffness = "K_c"
damping = "D_c"

[sensors.motor]
q_m = {{ body = "m", measures = "position" }}

[sensors.both]
q_m = {{ body = "m", measures = "position" }}
q_c = {{ body = "c", measures = "position" }}
"""
TRUTH = {
    "J_m": 1e-3, "F_vm": 0.01, "J_g": 5e-4, "J_c": 2e-3, "K_g": 50.0, "K_c": 70.0, "D_g": 0.02, "D_c": 0.05,
}  # fmt: skip


def model(sensors: str, hook: str = "m") -> Model:
    return spec_model(parse_spec(STAR.format(hook=hook), "star.toml"), sensors)


def test_branches_that_no_sensor_sees_may_be_exchanged() -> None:
    pairs = [("J_g", "J_c"), ("K_g", "K_c"), ("D_g", "D_c")]
    assert exchanges(model("motor")) == ({a: b for one in pairs for a, b in (one, one[::-1])},)


@pytest.mark.parametrize(("sensors", "hook"), [("both", "m"), ("motor", "g")])
def test_what_is_sensed_or_hangs_elsewhere_may_not(sensors: str, hook: str) -> None:
    assert exchanges(model(sensors, hook)) == ()


@pytest.mark.slow
def test_values_that_may_be_those_of_another_branch_are_no_estimates() -> None:
    # one of the two came out, off by a factor of four with 0.2 % stated
    record = simulate(model("motor"), TRUTH, "chirp", fs=2000.0, duration_s=4.0, noise={"T": 1e-3}).record
    estimate = identify(model("motor"), record)
    (other,) = estimate.parameters.other_solutions
    for name, twin in (("J_g", "J_c"), ("K_g", "K_c")):
        said = estimate.not_identifiable[name]
        assert said.endswith("no sensor tells apart what these values belong to")
        low, high = sorted(float(one) for one in said.removeprefix("may be ").split(":")[0].split(" or "))
        assert [low, high] == pytest.approx(sorted([TRUTH[name], TRUTH[twin]]), rel=1e-3)
        assert min(abs(other[name] / value - 1.0) for value in (TRUTH[name], TRUTH[twin])) < 1e-3
    assert estimate.physical["J_m"] == pytest.approx(TRUTH["J_m"], rel=1e-3)
