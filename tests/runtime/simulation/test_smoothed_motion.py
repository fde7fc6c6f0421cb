"""How bodies move beyond a simulation, from sensors elsewhere: against an integration in time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from scipy.signal import lsim

from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.smoothed_motion import Beyond, mirrored, smoothed_speeds
from modelgen.spec.load import parse_spec
from tests.runtime.two_mass_records import GEARED_TEXT, GEARED_TRUTH

FS, N = 2000.0, 12000
LEAST_HZ, MOST_HZ = 2.0, 200.0
NOISE = {"q_m": 1e-6, "v_c": 5e-4, "a_c": 1e-3, "a_m": 1e-2}
SENSORS = """
[sensors.all]
q_m = { body = "m", measures = "position" }
a_m = { body = "m", measures = "acceleration" }
v_c = { body = "c", measures = "velocity" }
a_c = { body = "c", measures = "acceleration" }
"""


@cache
def plant() -> Plant:
    text = GEARED_TEXT[: GEARED_TEXT.index("[sensors.s]")] + SENSORS
    return make_plant(spec_model(parse_spec(text, "geared.toml"), "all"), dict(GEARED_TRUTH))


@cache
def moved() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a push that is known, and what that and another, as of friction, do: speeds (2, n), readings."""
    rng = np.random.default_rng(3)
    known = 0.02 * np.sin(2.0 * np.pi * 1.7 * np.arange(N) / FS)
    unknown = np.zeros(N)
    for start in rng.integers(200, N - 200, 60):
        unknown[start : start + int(rng.integers(2, 12))] = 0.1 * rng.choice([-1.0, 1.0])
    space = plant().space((1,))
    A, B = np.asarray(space.A), np.asarray(space.B)
    system = A, B, np.vstack([np.eye(4), A[2:]]), np.vstack([np.zeros((4, 1)), B[2:]])
    _, found, _ = lsim(system, known + unknown, np.arange(N) / FS)
    return known, found[:, 2:4].T, found[:, [0, 4, 3, 5]].T


def difference(*keys: str, drift: float = 0.0) -> Beyond:
    """Return what some sensors read more than in a simulation, and the push that is known."""
    rng = np.random.default_rng(5)
    known, _, read = moved()
    places = {"q_m": 0, "a_m": 1, "v_c": 2, "a_c": 3}
    noisy: dict[str, FloatArray] = {}
    for key in keys:
        noisy[key] = read[places[key]] + NOISE[key] * rng.standard_normal(N)
        if key.startswith("a"):
            noisy[key] += drift * (1.0 + np.linspace(0.0, 1.0, N) ** 2)
    density: Mapping[str, float] = {key: 2.0 * NOISE[key] ** 2 / FS for key in keys}
    return Beyond(noisy, density, known, 1.0 / FS)


def error(body: int, *keys: str, drift: float = 0.0) -> float:
    """Return the rms error of a body's speed over its rms, means left out."""
    found = smoothed_speeds(plant(), difference(*keys, drift=drift), LEAST_HZ, MOST_HZ)
    assert found is not None
    true = moved()[1][body] - np.mean(moved()[1][body])
    wrong = found[body] - np.mean(found[body]) - true
    return float(np.std(wrong[200:-200]) / np.std(true))


@pytest.mark.parametrize(
    ("body", "keys"),
    [(0, ("v_c",)), (0, ("v_c", "a_c")), (0, ("v_c", "a_m")), (1, ("q_m",)), (1, ("q_m", "a_c"))],
)
def test_speed_of_a_body_without_a_sensor_of_its_own(body: int, keys: tuple[str, ...]) -> None:
    assert error(body, *keys) < 0.06


def test_an_accelerometer_shows_what_the_link_hides() -> None:
    assert error(0, "v_c", "a_m") < 0.5 * error(0, "v_c")


def test_drift_of_an_accelerometer_is_no_motion() -> None:
    assert error(0, "v_c", "a_m", drift=0.5) < 1.5 * error(0, "v_c", "a_m") + 0.01


def test_a_push_that_is_known_moves_the_chain_where_no_sensor_sees_much() -> None:
    """Noise that hides the whole motion leaves what the known push does."""
    known = moved()[0]
    space = plant().space((1,))
    A, B = np.asarray(space.A), np.asarray(space.B)
    _, expected, _ = lsim((A, B, np.eye(4)[3:], np.zeros((1, 1))), known, np.arange(N) / FS)
    deaf = Beyond({"v_c": np.zeros(N)}, {"v_c": 1e6}, known, 1.0 / FS)
    found = smoothed_speeds(plant(), deaf, LEAST_HZ, MOST_HZ)
    assert found is not None
    wrong = (found[1] - expected)[2000:-2000]
    assert np.std(wrong - np.mean(wrong)) < 0.1 * np.std(expected)


def test_what_is_mirrored_stays_a_motion() -> None:
    """Velocities are the derivatives of positions there, accelerations those of velocities."""
    t = np.arange(400) / 100.0
    q, v, a = np.sin(3.0 * t + 0.4), 3.0 * np.cos(3.0 * t + 0.4), -9.0 * np.sin(3.0 * t + 0.4)
    slope = (q[-1] - q[0]) / t[-1]
    far = slice(405, 795)
    np.testing.assert_allclose(np.gradient(mirrored(q, 0), 0.01)[far], mirrored(v, 1)[far] - slope, atol=0.01)
    bent = mirrored(a, 2)[far] - np.mean(a)
    np.testing.assert_allclose(np.gradient(mirrored(v, 1), 0.01)[far], bent, atol=0.01)


def test_extreme_chains_have_finite_answers() -> None:
    for extreme in ({"K": 1e30, "J_c": 1e-30}, {"K": 0.0, "D": 0.0}, {"J_m": 1e-30}):
        strange = make_plant(plant().model, {**GEARED_TRUTH, **extreme})
        found = smoothed_speeds(strange, difference("v_c", "a_m"), LEAST_HZ, MOST_HZ)
        assert found is None or np.all(np.isfinite(found))
