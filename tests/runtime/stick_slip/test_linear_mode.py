"""Steps of a mode without an event: the scan over groups of steps takes the same way as the scan over all."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.stick_slip import linear_mode
from modelgen.runtime.stick_slip.linear_mode import CoulombBody, FrictionSystem, ModeMotion


@pytest.mark.parametrize("steps", [1, 31, 32, 33, 100])
def test_groups_of_steps_change_nothing(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    A = np.array(
        [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [-0.04, 0.04, -0.01, 0.0], [0.02, -0.02, 0.0, -0.01]]
    )
    B = np.array([[0.0], [0.0], [1.0], [0.0]])
    system = FrictionSystem(lambda mode: A, B, np.zeros(4), (CoulombBody(3, 1.0, 0.1, 0.2),))
    motion = ModeMotion(system, (1,))
    rng = np.random.default_rng(4)
    x, w = rng.normal(size=4), rng.normal(size=(steps + 1, 1))
    plain, calm = motion.advance(x, w)
    monkeypatch.setattr(linear_mode, "MANY_STATES", 1)
    grouped, as_calm = motion.advance(x, w)
    assert grouped == pytest.approx(plain, abs=1e-12 * np.max(np.abs(plain)))
    assert as_calm == calm
    # one step after the other
    one = x
    for k in range(steps):
        one = motion.advance(one, w[k : k + 2])[0][0]
    assert plain[-1] == pytest.approx(one, abs=1e-11 * np.max(np.abs(plain)))
