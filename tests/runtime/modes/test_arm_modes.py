"""Modes of elastic arms about postures: against the matrices of textbooks, and their intervals."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eig, eigh

from modelgen import Estimate, identify
from modelgen.cli.arms.simulate_arm import arm_model
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.arm_modes import arm_modes, modes_of_arm
from modelgen.runtime.modes.modes import Modes, posture_ranges
from modelgen.runtime.results.estimate_file import load_estimate
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.symbolic.arms.arm_sensor_sets import with_usual_sets
from tests.runtime.made_arm_records import catalogued, model_of

POSTURES = np.array([[0.2, -0.4, 0.0], [1.1, 0.3, -2.0]])


@cache
def model() -> Model:
    return model_of(catalogued("elastic_two_link"), sensor_set="encoders")


def params() -> dict[str, float]:
    base = model().base_from_physical(model().parameter_sets["nominal"])
    return dict(zip(model().base_parameters, base.tolist(), strict=True))


def matrices(p: dict[str, float], q_2: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass, damping and stiffness of two links, then of their motors."""
    h = 0.5 * (p["mx_2"] * np.cos(q_2) - p["my_2"] * np.sin(q_2))
    mass = np.zeros((4, 4))
    mass[:2, :2] = [[p["Izz_1_R"] + p["Izz_2"] + 2.0 * h, p["Izz_2"] + h], [p["Izz_2"] + h, p["Izz_2"]]]
    mass[[2, 3], [2, 3]] = p["Ia_1"], p["Ia_2"]
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping, stiffness = (np.kron(spring, np.diag([p[f"{name}_1"], p[f"{name}_2"]])) for name in ("D", "K"))
    damping[[2, 3], [2, 3]] += p["Fv_1"], p["Fv_2"]
    return mass, damping, stiffness


def swinging(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    n = len(mass)
    lower = -np.linalg.solve(mass, np.hstack((stiffness, damping)))
    poles = eig(np.vstack((np.eye(n, 2 * n, n), lower)), right=False)
    return np.sort(np.abs(poles[poles.imag > 0.0]))[-2:] / (2.0 * np.pi)


def test_frequencies_are_those_of_the_matrices_of_textbooks() -> None:
    p = params()
    assert {"Izz_1_R", "Izz_2", "mx_2", "my_2"} <= set(p)
    found = arm_modes(model(), p, np.zeros((len(p), len(p))), POSTURES)
    for posture, q_2 in zip(found.postures, POSTURES[1], strict=True):
        mass, damping, stiffness = matrices(p, q_2)
        free = [one.frequency_hz.value for one in posture.free if one.frequency_hz]
        np.testing.assert_allclose(free, swinging(mass, damping, stiffness), rtol=1e-9)
        held = [one.frequency_hz.value for one in posture.held if one.frequency_hz]
        links = np.sqrt(eigh(stiffness[:2, :2], mass[:2, :2], eigvals_only=True)) / (2.0 * np.pi)
        np.testing.assert_allclose(held, links, rtol=1e-3)  # those without damping
        assert posture.positions["2"] == q_2 and posture.time_s is None


def test_deviations_are_those_of_the_formula() -> None:
    p, rng = params(), np.random.default_rng(1)
    names = list(p)
    sizes = 1e-3 * np.array([abs(value) or 0.1 for value in p.values()])
    factor = sizes[:, None] * rng.standard_normal((len(p), len(p))) / len(p) ** 0.5
    covariance = factor @ factor.T
    (posture,) = arm_modes(model(), p, covariance, POSTURES[:, :1]).postures
    slopes = []
    for name, size in zip(names, sizes, strict=True):
        ends = [swinging(*matrices({**p, name: p[name] + h * size}, POSTURES[1, 0])) for h in (0.5, -0.5)]
        slopes.append((ends[0] - ends[1]) / size)
    expected = np.sqrt(np.einsum("ik,ij,jk->k", slopes, covariance, slopes))
    found = [one.frequency_hz.std for one in posture.free if one.frequency_hz]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_what_has_no_number_is_said() -> None:
    p = params()
    less = {name: value for name, value in p.items() if name != "Izz_2"}
    found = arm_modes(model(), less, np.zeros((len(less), len(less))), POSTURES)
    assert not found.postures and "Izz_2 without a number" in found.notes[0]
    undamped = {name: value for name, value in p.items() if name != "D_1"}
    found = arm_modes(model(), undamped, np.zeros((len(undamped), len(undamped))), POSTURES)
    assert found.postures[0].free[0].damping_ratio is None
    wrong = {**p, "Izz_1_R": -1.0}
    found = arm_modes(model(), wrong, np.zeros((len(p), len(p))), POSTURES, [("r", 0.0)] * 3)
    assert "positive definite" in found.notes[0]


@cache
def estimate() -> Estimate:
    noise = {"tau_1": 0.1, "tau_2": 0.1}
    values = model().parameter_sets["nominal"]
    return identify(model(), simulate_arm(model(), values, noise=noise, duration_s=5.0).record, "wls")


def test_an_estimate_tells_them_over_the_postures_of_its_records() -> None:
    found = estimate().modes()
    truth = arm_modes(
        model(),
        params(),
        np.zeros((18, 18)),
        np.array([[one.positions[name] for one in found.postures] for name in "12"]),
    )
    assert 2 <= len(found.postures) <= 4
    for ours, theirs in zip(found.postures, truth.postures, strict=True):
        for one, other in zip(ours.free, theirs.free, strict=True):
            assert one.frequency_hz is not None and other.frequency_hz is not None
            assert abs(one.frequency_hz.value - other.frequency_hz.value) < 4.0 * one.frequency_hz.std
    printed = str(estimate())
    assert printed.count("mode, motors free") == 2 and printed.count("mode, motors held") == 2
    assert "at q_1 = " in str(found)
    low = posture_ranges(found)[0]
    assert low.motors == "free" and low.low.frequency_hz.value <= low.high.frequency_hz.value


def test_they_are_saved_with_the_estimate(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "estimate.json"
    estimate().save(path)
    assert len(load_estimate(path)["modes"]["postures"]) == len(estimate().modes().postures)


def test_arms_without_springs_have_none_and_other_sensors_say_what_they_need() -> None:
    rigid = model_of(catalogued("two_link"))
    record = simulate_arm(rigid, rigid.parameter_sets["nominal"], duration_s=2.0, fs=500.0).record
    assert identify(rigid, record, "wls").modes() == Modes()
    spec = catalogued("elastic_two_link")
    gyros = [one for one in spec.sensor_sets["rates"] if one.measures == "gyro"]
    seen = replace(spec, sensor_sets={"s": (*spec.sensor_sets["encoders"], *gyros)})
    both = model_of(seen, sensor_set="s")
    assert "not gyros" in modes_of_arm(both, {}, np.zeros((0, 0)), [record]).notes[0]


@pytest.mark.parametrize(
    "kinds",
    [
        "motor encoders",
        "motor encoders, link speeds",
        "motor encoders, link accelerometers",
        "motor and link encoders, joint torques",
        "link encoders, joint torques",
        "link encoders",
    ],
)
def test_every_sensor_set_has_them_from_its_own_rows(kinds: str) -> None:
    arm = with_usual_sets(catalogued("elastic_two_link"))
    own = model_of(replace(arm, sensor_sets={"s": arm.sensor_sets[kinds]}), sensor_set="s")
    p, none = params(), np.zeros((len(params()), len(params())))
    wanted, found = (arm_modes(one, p, none, POSTURES).postures for one in (model(), own))
    for ours, theirs in zip(found, wanted, strict=True):
        for side in ("free", "held"):
            frequencies = [[one.frequency_hz.value for one in getattr(at, side)] for at in (ours, theirs)]
            np.testing.assert_allclose(frequencies[0], frequencies[1], rtol=1e-12)


def test_postures_are_those_of_the_motors_where_no_link_is_seen() -> None:
    spec = catalogued("elastic_two_link")
    p, none = params(), np.zeros((len(params()), len(params())))
    arm = replace(
        spec, sensor_sets={"s": tuple(s for s in spec.sensor_sets["encoders"] if s.side == "motor")}
    )
    record = simulate_arm(model(), model().parameter_sets["nominal"], duration_s=2.0, fs=500.0).record
    alone, whole = (
        modes_of_arm(one, p, none, [record]).postures for one in (model_of(arm, sensor_set="s"), model())
    )
    # the springs deflect by some mrad
    ends = [[min(one.held[0].frequency_hz.value for one in told) for told in (alone, whole)]]
    assert all(ours == pytest.approx(theirs, rel=1e-2) for ours, theirs in ends)


@pytest.mark.parametrize("gear", ["1", "50"])
def test_gears_change_nothing_seen_from_the_joint(gear: str) -> None:
    spec = catalogued("elastic_two_link")
    ratio = type(spec.transmission[0][0])(int(gear))
    spec = replace(spec, transmission=tuple(tuple(ratio * x for x in row) for row in spec.transmission))
    found = arm_modes(arm_model(spec), params(), np.zeros((18, 18)), POSTURES)
    assert found.postures[0].free[0].frequency_hz.value == pytest.approx(
        swinging(*matrices(params(), POSTURES[1, 0]))[0]
    )
