"""Chains with a spring that hardens: the closed loop, the sensors, and back from record to parameters."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.stick_slip import compiled_steps as stepping
from modelgen.spec.load import parse_spec

SPEC = """
[chain]
name = "hardening"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "T"
[[bodies]]
name = "c"
inertia = "J_c"
coulomb = "F_sc"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"
stiffness3 = "K3"
ratio = 2.0
[parameters.p]
J_m = 1e-3
F_vm = 1e-3
F_sm = 0.05
J_c = 2e-3
F_sc = 0.03
K = 20.0
D = 1e-3
K3 = 4e4
[sensors.positions]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
[sensors.all]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
acc_c = { body = "c", measures = "acceleration" }
twist = { deflection = ["m", "c"], measures = "acceleration" }
"""
CHAIN = parse_spec(SPEC, "hardening.toml")
LOOP = PositionVelocityController(kp=1.5, kv=0.1)
SAMPLED = Drive(rate_hz=2000.0, delay_s=5e-4, bandwidth_hz=300.0, limit=2.0)


@pytest.fixture(scope="module")
def model() -> Model:
    return model_from_text(generate(CHAIN, "all"))


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Drive(), SAMPLED], ids=["continuous", "sampled"])
@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
def test_the_equations_of_motion_hold_at_every_sample(model: Model, kind: str, drive: Drive) -> None:
    p = model.parameter_sets["p"]
    found = simulate(model, p, kind, fs=2000.0, oversample=8, drive=drive, controller=LOOP)
    x = found.true
    stretch = x["q_m"] / 2.0 - x["q_c"]
    assert p["K3"] * np.abs(stretch).max() ** 2 > 0.1 * p["K"]
    link = p["K"] * stretch + p["K3"] * stretch**3 + p["D"] * (x["v_m"] / 2.0 - x["v_c"])
    motor = p["J_m"] * x["a_m"] + p["F_vm"] * x["v_m"] + x["friction_m"] + link / 2.0
    size = np.abs(x["T"]).max()
    np.testing.assert_allclose(x["T"], motor, atol=1e-11 * size)
    np.testing.assert_allclose(p["J_c"] * x["a_c"] + x["friction_c"], link, atol=1e-11 * size)
    assert {change.body for change in found.changes} == {"m", "c"}
    for body in ("m", "c"):
        rests = x[f"mode_{body}"] == 0.0
        assert np.all(np.abs(x[f"friction_{body}"][rests]) <= p[f"F_s{body}"] * (1.0 + 1e-12))
    np.testing.assert_allclose(x["acc_c"], x["a_c"], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(x["twist"], x["a_m"] / 2.0 - x["a_c"], rtol=1e-9, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Drive(), SAMPLED], ids=["continuous", "sampled"])
def test_compiled_or_not_the_motion_is_the_same(
    model: Model, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    p = model.parameter_sets["p"]
    excitation = default_excitation("trapezoid", model, p, 2000.0, duration_s=0.15, oversample=8)
    fast = simulate(model, p, excitation, fs=2000.0, oversample=8, drive=drive, controller=LOOP)
    monkeypatch.setattr(stepping, "has_numba", lambda: False)
    stepping._kernel.cache_clear()
    plain = simulate(model, p, excitation, fs=2000.0, oversample=8, drive=drive, controller=LOOP)
    stepping._kernel.cache_clear()
    assert [c.body for c in plain.changes] == [c.body for c in fast.changes]
    for key in ("q_m", "q_c", "acc_c"):
        np.testing.assert_allclose(plain.true[key], fast.true[key], atol=1e-10 * np.abs(fast.true[key]).max())


def test_without_the_cube_it_is_the_linear_chain(model: Model) -> None:
    soft = {**model.parameter_sets["p"], "K3": 0.0}
    a, b = (
        simulate(one, soft, "chirp", fs=2000.0, oversample=8).true
        for one in (model, replace(model, cubic_springs=()))
    )
    for key in ("q_m", "q_c", "v_c", "acc_c"):
        np.testing.assert_allclose(a[key], b[key], atol=1e-10 * np.abs(b[key]).max())


@pytest.mark.slow
def test_a_record_gives_the_cubic_stiffness_back() -> None:
    positions = model_from_text(generate(CHAIN, "positions"))
    p = positions.parameter_sets["p"]
    noise = {"q_m": 1e-6, "q_c": 1e-6, "T": 1e-4}
    records = [
        simulate(positions, p, kind, fs=4000.0, oversample=8, noise=noise, seed=i).record
        for i, kind in enumerate(("chirp", "trapezoid"))
    ]
    found = identify(positions, records).physical
    assert found["K"] == pytest.approx(p["K"], rel=0.01)
    assert found["K3"] == pytest.approx(p["K3"], rel=0.03)


def test_a_loop_that_runs_away_is_explained(model: Model) -> None:
    with pytest.raises(DataError, match="grows without bound"):
        simulate(
            model, model.parameter_sets["p"], "chirp", fs=2000.0, oversample=4,
            controller=PositionVelocityController(-5.0, -0.1),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("springs", "message"),
    [
        ((), "CUBIC_SPRINGS: lacks 'K3'; generate the module again"),
        (({"parameter": "K3", "deflection": ((0, 0.5), (7, -1.0))},), "a coordinate beyond the 2 bodies"),
        (({"parameter": "K3", "deflection": ((0, "x"),)},), "not \\(coordinate, coefficient\\) pairs"),
    ],
)
def test_a_module_must_name_its_springs(model: Model, springs: object, message: str) -> None:
    changed = SimpleNamespace(**{**vars(model.module), "CUBIC_SPRINGS": springs})
    with pytest.raises(DataError, match=message):
        model_from_module(changed)
