"""Elastic arms in closed loop: against integrators, against chains that are exact, and all their sensors."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from modelgen import identify
from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.simulation.arms.arm_plant import arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference, fourier_reference
from modelgen.runtime.simulation.arms.simulate_arm import (
    ArmSimulation,
    record_with_joint_references,
    simulate_arm,
)
from modelgen.runtime.simulation.arms.validate_arm import validate_arm
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.made_arm_records import catalogued, model_of, of_bodies, written

ONE = '[arm]\nname = "one"\ngravity = [0, 0, 0]\n[[joints]]\nname = "1"\nstiffness = true\ndamping = true\n'
GEARED = """
[arm]
name = "geared"
gravity = [0, 0, -9.81]
[[joints]]
name = "a"
r = 0.3
gear = 30
[[joints]]
name = "b"
alpha = -90
d = 0.1
gear = -40
stiffness = true
damping = true
stiffness3 = true
[[joints]]
name = "c"
d = 0.4
gear = 30
friction = "asymmetric"
[[couplings]]
motor = "c"
joint = "b"
ratio = 30
"""
CHAIN = """
[chain]
name = "pair"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_v"
coulomb = "F_s"
offset = "O"
actuator = "G"
[[bodies]]
name = "c"
inertia = "J_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"
[sensors.both]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""


@cache
def two_link() -> tuple[Model, dict[str, float]]:
    model = model_of(catalogued("elastic_two_link"), sensor_set="encoders")
    return model, dict(model.parameter_sets["nominal"])


@cache
def moved() -> ArmSimulation:
    model, values = two_link()
    return simulate_arm(model, values, duration_s=2.0)


@pytest.mark.parametrize("friction", [0.0, 2.0])
@pytest.mark.parametrize("stiff", [300.0, 3e4])
def test_one_elastic_joint_moves_as_the_chain_of_motor_and_body(friction: float, stiff: float) -> None:
    model = model_of(written(ONE), sensor_set="encoders")
    chain = model_from_text(generate(parse_spec(CHAIN, "pair.toml"), "both"), "pair")
    values = dict.fromkeys(model.parameters, 0.0)
    values |= {"Izz_1": 0.5, "Ia_1": 0.3, "Fv_1": 0.7, "Fs_1": friction, "K_1": stiff, "D_1": 0.8}
    if friction:
        reference, start = fourier_reference(model, 3.0, 1000.0), None
        fine = reference.motion.finer(20)
    else:  # held, from beside it: nothing lies between samples that is not the arm itself
        fine = JointMotion(np.zeros((1, 1001)), *np.zeros((2, 1, 1001)), 1000.0)
        reference, start = JointReference(fine), [0.1, -0.05, 0.4, -0.3]
    found = simulate_arm(
        model, values, reference, controller=JointController(kp=200.0, kv=20.0), initial_state=start
    )
    begun = [float(found.true[key][0]) for key in ("qm_1", "q_1", "d1_qm_1", "d1_q_1")]
    exact = simulate(
        chain,
        {"J_m": 0.3, "J_c": 0.5, "F_v": 0.7, "F_s": friction, "O": 0.0, "K": stiff, "D": 0.8},
        Excitation(fine.q[0], fine.v[0], np.zeros(fine.n), fine.rate_hz, "x"),
        fs=1000.0,
        controller=PositionVelocityController(200.0, 20.0),
        initial_state=begun,
    )
    for ours, theirs in (("qm_1", "q_m"), ("q_1", "q_c")):
        apart = np.abs(found.true[ours] - exact.true[theirs])
        assert apart.max() < (4e-7 if friction else 1e-11)
    assert [change.mode for change in found.changes] == [change.mode for change in exact.changes]
    assert (len(found.changes) > 2) == (friction > 0.0)


@pytest.mark.parametrize("law", ["pd", pytest.param("computed_torque", marks=pytest.mark.slow)])
def test_two_links_move_as_an_integrator_says(law: str) -> None:
    model, values = two_link()
    values = {**values, "Fs_1": 0.0, "Fs_2": 0.0}
    held = JointMotion(np.full((2, 801), 0.2), np.zeros((2, 801)), np.zeros((2, 801)), 4000.0)
    start = np.array([0.3, -0.1, 0.35, -0.2, 0.5, 0.0, -1.0, 0.4])
    controller = JointController(law=law)
    found = simulate_arm(model, values, JointReference(held), controller=controller, initial_state=start)
    plant = arm_plant(model, checked_base(model, values))
    kp, kv = controller.gains(plant, held)

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        q, v = x[:4, None], x[4:, None]
        wanted = kp * (0.2 - x[2:4]) - kv * x[6:]
        if law == "computed_torque":  # of the arm without springs, at its motors
            both = [np.tile(one, 2)[:, None] for one in (x[2:4], x[6:], wanted)]
            wanted = plant.smooth(*both)[:, 0].reshape(2, 2).sum(axis=0)
        lacking = np.r_[0.0, 0.0, wanted] - plant.smooth(q, v, 0.0 * q)[:, 0]
        return np.r_[x[4:], np.linalg.solve(plant.mass(q, v)[0], lacking)]

    exact = solve_ivp(rate, (0.0, 0.2), start, "DOP853", rtol=1e-10, atol=1e-12, t_eval=[0.1, 0.2]).y
    names = ("q_1", "q_2", "qm_1", "qm_2", "d1_q_1", "d1_q_2", "d1_qm_1", "d1_qm_2")
    apart = np.abs([found.true[name][[400, 800]] for name in names] - exact)
    assert apart[:4].max() < 1e-9 and apart[4:].max() < 1e-7


def test_links_begin_where_their_springs_carry_them() -> None:
    """At the reference's acceleration; motors begin on the reference, and sag behind PD as rigid arms do."""
    _, values = two_link()
    true, reference = moved().true, moved().reference.motion
    for name, r in zip("12", reference.q, strict=True):
        assert true[f"qm_{name}"][0] == r[0]
        torque = values[f"K_{name}"] * (true[f"qm_{name}"][0] - true[f"q_{name}"][0])
        assert abs(torque) > 1.0 and abs(true[f"d2_q_{name}"][0]) < 1e-9


@pytest.mark.slow
def test_rows_hold_with_gears_couplings_and_a_single_spring() -> None:
    model = model_of(written(GEARED), sensor_set="encoders")
    values = {**of_bodies(model, 3), "K_b": 3000.0, "D_b": 2.0, "K3_b": 2e6}
    found = simulate_arm(model, values, duration_s=1.0, fs=500.0)
    signals = {key: found.true[key] for key in model.module.SIGNALS}
    left = model.measurement(signals) - model.regressor(signals) @ model.base_from_physical(values)
    modes = np.array([line for key, line in found.true.items() if key.startswith("mode_")])
    calm = np.all(modes != 0.0, axis=0) & np.all(np.diff(modes, axis=1, prepend=0.0) == 0.0, axis=0)
    calm &= np.all(np.diff(modes, axis=1, append=0.0) == 0.0, axis=0)
    assert calm.mean() > 0.6
    assert np.abs(left[calm]).max() < 1e-9 * np.abs(model.measurement(signals)).max()
    assert found.joints == ("a", "b", "c") and "motor_c_motor" not in found.record.signals


def test_a_motor_sticks_while_its_link_swings() -> None:
    model, values = two_link()
    values = {**values, "Fs_1": 90.0, "Fs_2": 40.0}
    still = JointMotion(*np.zeros((3, 2, 1001)), 1000.0)
    start = [0.02, 0.0, 0.0, 0.0, *np.zeros(4)]
    true = simulate_arm(model, values, JointReference(still), initial_state=start).true
    assert np.all(true["mode_1"][1:] == 0.0) and np.abs(true["qm_1"]).max() < 1e-12
    assert np.ptp(true["q_1"]) > 0.01 and (np.diff(np.sign(true["d1_q_1"])) != 0.0).sum() > 5


def test_what_is_simulated_is_identified() -> None:
    model, values = two_link()
    noise = dict.fromkeys(("tau_1", "tau_2"), 1e-2)
    found = identify(model, simulate_arm(model, values, noise=noise, duration_s=5.0).record, "wls")
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    names = ("K_1", "K_2", "Ia_1", "Ia_2")
    assert max(abs(found.params[name] - truth[name]) / found.bse[name] for name in names) < 4.0
    assert max(found.bse[name] / truth[name] for name in names[:2]) < 1e-3


def test_a_closed_loop_is_validated_with_the_truth_and_with_a_soft_spring() -> None:
    model, values = two_link()
    record = record_with_joint_references(moved())
    (right,) = validate_arm(model, values, [record], JointController())
    assert {check.channel for check in right.checks} == set(model.channels)
    # its first speeds are those of filters at the record's end
    assert min(check.fit for check in right.checks) > 95.0
    (soft,) = validate_arm(model, {**values, "K_2": 300.0}, [record], JointController())
    assert min(check.fit for check in soft.checks) < 90.0


@pytest.mark.parametrize(
    ("change", "what"), [({"K_1": 0.0}, "stiffness must be positive"), ({"Ia_2": 0.0}, "no positive inertia")]
)
def test_parameters_that_no_arm_has_are_refused(change: dict[str, float], what: str) -> None:
    model, values = two_link()
    with pytest.raises(DataError, match=what):
        simulate_arm(model, {**values, **change}, duration_s=1.0)


def test_a_model_without_all_encoders_says_which_one_is_needed() -> None:
    model = model_of(catalogued("elastic_two_link"), sensor_set="rates")
    with pytest.raises(DataError, match="encoders at every motor and on every link"):
        simulate_arm(model, model.parameter_sets["nominal"], duration_s=1.0)


def test_fast_motion_is_followed_as_exactly_as_slow_motion() -> None:
    """Sines of 20 Hz, 50 samples a period: what the controller pushes changes much within a step."""
    model, values = two_link()
    values = {**values, "Fs_1": 0.0, "Fs_2": 0.0}
    found = []
    for fs in (1000.0, 8000.0):
        angle = 40.0 * np.pi * np.arange(int(0.2 * fs) + 1) / fs
        rate = 40.0 * np.pi
        motion = [0.02 * rate**k * np.array([np.sin(angle + k * np.pi / 2)] * 2) for k in range(3)]
        found.append(simulate_arm(model, values, JointReference(JointMotion(*motion, fs))).true)
    for name, scale in (("qm_1", 2e-2), ("q_1", 2e-3), ("d2_qm_1", 300.0)):
        assert np.abs(found[0][name] - found[1][name][::8]).max() < 5e-5 * scale


@pytest.mark.slow
def test_fast_motion_on_cubic_springs_is_solved_in_shorter_stretches() -> None:
    """Rounds that begin far from the motion pass masses that cannot be inverted; shorter ones do not."""
    spec = catalogued("elastic_two_link")
    spec = replace(spec, joints=tuple(replace(one, stiffness3=f"K3_{one.name}") for one in spec.joints))
    model = model_of(spec, sensor_set="encoders")
    values = {**spec.parameter_sets["nominal"], "K3_1": 1e6, "K3_2": 3e5}
    t = np.arange(0.0, 0.1, 1e-3)
    w = 2.0 * np.pi * 10.0
    q = 0.3 * np.array([np.sin(w * t), np.cos(w * t)])
    speed = 0.3 * w * np.array([np.cos(w * t), -np.sin(w * t)])
    reference = JointReference(JointMotion(q, speed, -(w**2) * q, 1e3))
    true = simulate_arm(model, {name: values[name] for name in model.parameters}, reference).true
    for name in ("q_1", "q_2", "qm_1", "qm_2"):
        moved = np.diff(true[name])
        within = 0.5e-3 * (true[f"d1_{name}"][1:] + true[f"d1_{name}"][:-1])
        np.testing.assert_allclose(moved, within, atol=0.02 * np.abs(moved).max())
