"""What a body without a sensor does while another one is moved: against an integration in time."""

from __future__ import annotations

import numpy as np
from scipy.signal import lsim

from modelgen.runtime.simulation.followed_motion import followed_motion
from modelgen.runtime.simulation.plant import make_plant
from tests.runtime.two_mass_records import GEARED, GEARED_TRUTH

FS = 2000.0
T = np.arange(8000) / FS
# the load reaches the motor's angle over the ratio; it is at rest at the beginning
MOVED = 3.0 * np.sin(2.0 * np.pi * 0.8 * T) ** 3 + 0.5 * np.sin(2.0 * np.pi * 12.0 * T) * np.minimum(T, 1.0)


def test_a_load_follows_its_motor_as_an_integration_says() -> None:
    plant = make_plant(GEARED, dict(GEARED_TRUTH))
    K, D, J = (GEARED_TRUTH[name] for name in ("K", "D", "J_c"))
    _, expected, _ = lsim(([D / 100.0, K / 100.0], [J, D, K]), MOVED, T)
    found = followed_motion(plant, "c", {"m": MOVED}, 1.0 / FS)
    inner = slice(400, -400)
    assert np.std(found - expected) < 0.1 * np.std(expected)
    assert np.max(np.abs(found - expected)[inner]) < 2e-3 * np.max(np.abs(expected))


def test_it_follows_a_constant_by_the_ratio_and_rings_no_longer_than_friction_lets_it() -> None:
    undamped = {**GEARED_TRUTH, "D": 0.0}
    plant = make_plant(GEARED, undamped)
    np.testing.assert_allclose(followed_motion(plant, "c", {"m": np.full(500, 2.0)}, 1.0 / FS), 0.02, 1e-5)
    kicked = np.zeros(8000)
    kicked[100] = 1.0
    found = np.abs(followed_motion(plant, "c", {"m": kicked}, 1.0 / FS))
    assert np.max(found[7000:]) < 0.5 * np.max(found)


def test_a_body_that_no_spring_holds_stays_finite() -> None:
    loose = {**GEARED_TRUTH, "K": 0.0, "D": 0.0}
    assert np.all(np.isfinite(followed_motion(make_plant(GEARED, loose), "c", {"m": MOVED}, 1.0 / FS)))
