"""Arms in closed loop: against an integrator, against chains with exact stick and slip, and identified."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import modelgen
from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.simulation.arms.arm_plant import arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_controller import JointController, tracking
from modelgen.runtime.simulation.arms.joint_reference import fourier_reference
from modelgen.runtime.simulation.arms.simulate_arm import ArmSimulation, simulate_arm
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.made_arm_records import catalogued, model_of, of_bodies, written

ONE = '[arm]\nname = "one"\ngravity = [0, 0, 0]\n[[joints]]\nname = "1"\n'
BODY = """
[chain]
name = "body"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J"
viscous = "F_v"
coulomb = "F_s"
offset = "O"
actuator = "G"
[sensors.q]
q = { body = "m", measures = "position" }
"""
GAIN = """
[arm]
name = "geared"
gravity = [0, 0, -9.81]
[[joints]]
name = "a"
alpha = 90
gear = 50
gain = true
friction = "asymmetric"
[[joints]]
name = "b"
d = 0.4
gear = -30
[[couplings]]
motor = "b"
joint = "a"
ratio = 12
[known]
gain_a = 0.8
Fs_b = 0.7
"""


@cache
def two_link() -> Model:
    return model_of(catalogued("two_link"))


@cache
def moved(name: str, duration_s: float = 4.0) -> tuple[Model, dict[str, float], ArmSimulation]:
    model = model_of(written(GAIN) if name == "geared" else catalogued(name))
    values = of_bodies(model, 3)
    return model, values, simulate_arm(model, values, duration_s=duration_s, fs=500.0)


@pytest.mark.parametrize(
    "controller",
    [
        pytest.param(JointController(), marks=pytest.mark.slow),
        JointController(law="computed_torque", bandwidth_hz=3.0),
        JointController(kp=(30.0, 10.0), kv=(20.0, 4.0), rate_gain=0.5),
    ],
    ids=["pd", "computed torque", "weak pd"],
)
def test_without_friction_the_motion_is_that_of_an_integrator_with_fine_steps(
    controller: JointController,
) -> None:
    model = two_link()
    values = {**model.parameter_sets["nominal"], "Fs_1": 0.0, "Fs_2": 0.0}
    found = simulate_arm(model, values, controller=controller, duration_s=1.0)
    reference = found.reference.motion
    plant = arm_plant(model, checked_base(model, values))
    law = tracking(plant, controller, reference)
    t = np.arange(reference.n) / reference.rate_hz
    q_r, v_r, a_r = (CubicSpline(t, one, axis=1) for one in (reference.q, reference.v, reference.a))

    def rate(time: float, x: np.ndarray) -> np.ndarray:
        q, v = x[:2, None], x[2:, None]
        error = law.kp[:, None] * (q_r(time)[:, None] - q)
        if controller.law == "pd":
            push = error + law.kv[:, None] * (controller.rate_gain * v_r(time)[:, None] - v)
        else:
            wanted = a_r(time)[:, None] + error + law.kv[:, None] * (v_r(time)[:, None] - v)
            push = plant.smooth(q, v, wanted)
        return np.r_[x[2:], np.linalg.solve(plant.mass(q, v)[0], push - plant.smooth(q, v, 0.0 * q))[:, 0]]

    start = np.r_[reference.q[:, 0], reference.v[:, 0]]
    exact = solve_ivp(rate, (0.0, 0.3), start, rtol=1e-9, atol=1e-11, t_eval=t[:301:100]).y
    names = ("q_1", "q_2", "d1_q_1", "d1_q_2")
    np.testing.assert_allclose([found.true[name][:301:100] for name in names], exact, atol=1e-6)


@pytest.mark.parametrize("fs", [500.0, pytest.param(2000.0, marks=pytest.mark.slow)])
def test_one_joint_sticks_and_slips_as_a_body_of_a_chain(fs: float) -> None:
    model, chain = model_of(written(ONE)), parse_spec(BODY, "body.toml")
    body = model_from_text(generate(chain, "q"), "body")
    values = dict.fromkeys(model.parameters, 0.0)
    values |= {"Izz_1": 0.5, "Ia_1": 0.3, "Fv_1": 0.7, "Fs_1": 2.0, "off_1": 0.1}
    reference = fourier_reference(model, 3.0, fs)
    found = simulate_arm(model, values, reference, controller=JointController(kp=400.0, kv=30.0))
    fine, motion = reference.motion.finer(4), reference.motion
    excitation = Excitation(fine.q[0], fine.v[0], np.zeros(fine.n), 4.0 * fs, "x")
    exact = simulate(
        body,
        {"J": 0.8, "F_v": 0.7, "F_s": 2.0, "O": 0.1},
        excitation,
        fs=fs,
        controller=PositionVelocityController(400.0, 30.0),
        initial_state=[motion.q[0, 0], motion.v[0, 0]],
    )
    np.testing.assert_allclose(found.true["q_1"], exact.true["q"], atol=2e-6)
    np.testing.assert_allclose(found.true["tau_1"], exact.true["G"], atol=2e-3)
    assert [change.mode for change in found.changes] == [change.mode for change in exact.changes]
    apart = [a.time_s - b.time_s for a, b in zip(found.changes, exact.changes, strict=True)]
    assert np.max(np.abs(apart)) < 1.5 / min(fs, 1000.0)
    sticking = found.true["mode_1"] == 0.0
    assert sticking[1:-1].any() and np.abs(found.true["d1_q_1"][1:-1][sticking[1:-1]]).max() < 1e-12


@pytest.mark.parametrize("name", ["two_link", pytest.param("tx40", marks=pytest.mark.slow), "geared"])
def test_rows_of_the_module_hold_with_the_parameters(name: str) -> None:
    """Gears, couplings, gains, friction by direction, known parameters; where no friction is in between."""
    model, values, found = moved(name)
    true = found.true
    signals = {key: true[key] for key in model.module.SIGNALS}
    left = model.measurement(signals) - model.regressor(signals) @ model.base_from_physical(values)
    modes = np.array([line for key, line in true.items() if key.startswith("mode_")])
    # neither sticking nor in a step in which a speed turns
    calm = np.all(modes != 0.0, axis=0) & np.all(np.diff(modes, axis=1, prepend=0.0) == 0.0, axis=0)
    calm &= np.all(np.diff(modes, axis=1, append=0.0) == 0.0, axis=0)
    assert calm.mean() > 0.6
    scale = np.abs(model.measurement(signals)).max()
    assert np.abs(left[calm]).max() < 1e-9 * scale
    assert set(model.channels) == set(found.record.signals)


@pytest.mark.parametrize("name", ["two_link", pytest.param("scara", marks=pytest.mark.slow)])
def test_what_is_simulated_is_identified(name: str) -> None:
    model, values, _ = moved(name)
    noise = dict.fromkeys(("tau_1", "tau_2"), 1e-3)
    record = simulate_arm(model, values, noise=noise, duration_s=6.0, fs=500.0).record
    found = modelgen.identify(model, record)
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    apart = [(value - truth[key]) / found.bse[key] for key, value in found.params.items()]
    assert len(apart) > 10 and np.max(np.abs(apart)) < 4.0


def test_channels_draw_their_own_noise_and_steps() -> None:
    model, values = two_link(), two_link().parameter_sets["nominal"]
    options = {"duration_s": 1.0, "fs": 500.0}
    plain = simulate_arm(model, values, **options)
    noisy = simulate_arm(model, values, noise={"tau_2": 0.1}, resolution={"q_1": 1e-3}, seed=4, **options)
    assert np.array_equal(noisy.record.signals["q_2"], plain.record.signals["q_2"])
    assert np.std(noisy.record.signals["tau_2"] - plain.true["tau_2"]) == pytest.approx(0.1, rel=0.15)
    counts = noisy.record.signals["q_1"] / 1e-3
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"Ia_1": -1.0}, "negative"),
        ({"Fs_2": -1.0}, "friction"),
        ({"m_2": None}, "missing"),
        ({"m_2": float("nan")}, "nan"),
        ({"Izz_2": -3.0}, "no positive inertia"),
        ({"mx_2": 5.0}, "positive definite"),
        ({"Fv_2": 1e9}, "too fast"),
    ],
)
def test_parameters_that_no_arm_has_are_refused(change: dict[str, float | None], what: str) -> None:
    model = two_link()
    values = {**model.parameter_sets["nominal"], **change}
    with pytest.raises(DataError, match=what):
        simulate_arm(model, {name: v for name, v in values.items() if v is not None}, duration_s=1.0)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"noise": {"q_9": 1.0}}, "q_9"),
        ({"noise": {"tau_1": -1.0}}, "tau_1"),
        ({"duration_s": 0.0}, "samples"),
        ({"duration_s": float("nan")}, "samples"),
        ({"fs": -1.0}, "fs"),
        ({"seed": -1}, "seed"),
        ({"initial_state": [0.0]}, "initial_state"),
        ({"controller": PositionVelocityController(1.0, 1.0)}, "JointController"),
        ({"controller": JointController(kp=(1.0, 2.0, 3.0))}, "3 numbers for 2 joints"),
        ({"wrong": 1}, "wrong"),
    ],
)
def test_options_that_do_not_fit_are_told(options: SimpleNamespace, what: str) -> None:
    model = two_link()
    with pytest.raises((DataError, TypeError), match=what):
        simulate_arm(model, model.parameter_sets["nominal"], **options)
