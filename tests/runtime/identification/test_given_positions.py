"""Steps to the point about which rows are linear: where they come to rest, and what noise does to that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification import given_positions
from modelgen.runtime.identification.given_positions import Rest
from modelgen.runtime.identification.thresholds import POINT_TOLERANCE

NAMES = ("K", "M", "D")
MODEL: Any = SimpleNamespace(base_parameters=NAMES)
JOB: Any = SimpleNamespace(model=MODEL, choice=SimpleNamespace(dynamics_hz=5.0, cutoff_hz=20.0))
GOAL = np.array([3.0, 1.0, 2.0])
TRIANGLE = np.array([[2.0, 1.0, 0.5, 0.0], [0.0, 3.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
FIT: Any = SimpleNamespace(columns=NAMES, triangle=TRIANGLE)


class Kernel:
    """One that never refuses a point."""

    giving = ()
    lag = 0.0
    speeds: tuple[str, ...] = ()

    def at(self, _: np.ndarray) -> Kernel:
        return self


def map_of(shares: tuple[float, float, float]) -> np.ndarray:
    """Return what a step makes of the distance to the goal: symmetric in the weighted rows."""
    rows = TRIANGLE[:3, :3]
    turned = np.linalg.qr(np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 1.0], [0.0, 1.0, 1.0]]))[0]
    return np.asarray(np.linalg.solve(rows, turned @ np.diag(shares) @ turned.T @ rows))


def rested(monkeypatch: pytest.MonkeyPatch, shares: tuple[float, float, float]) -> tuple[Rest | None, int]:
    """Return where steps of such a map rest, and how many fits that took."""
    fits: list[np.ndarray] = []
    step = map_of(shares)
    monkeypatch.setattr(given_positions, "_fit", lambda job, kernel, point: fits.append(point) or FIT)
    monkeypatch.setattr(given_positions, "_moved", lambda *at: GOAL + step @ (at[-1] - GOAL))
    kernel: Any = Kernel()
    return given_positions._rested(JOB, kernel, GOAL + np.array([0.3, -0.2, 0.4])), len(fits)


@pytest.mark.parametrize("share", [0.01, 0.6, 0.86, 0.9])
def test_steps_that_shrink_slowly_come_to_rest_at_their_goal(
    monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    rest, fits = rested(monkeypatch, (share, 0.02, -0.01))
    assert rest is not None
    assert np.linalg.norm(TRIANGLE[:3, :3] @ (rest.point - GOAL)) < 5.0 * POINT_TOLERANCE
    assert fits <= 9


def test_the_goal_of_steps_that_grow_is_no_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    assert rested(monkeypatch, (1.15, 0.02, -0.01))[0] is None


@pytest.mark.parametrize(("noise", "near"), [(1e-3, 1e-3), (100.0, 2.0)])
def test_rows_with_open_forces_take_steps_to_their_own_estimate(
    monkeypatch: pytest.MonkeyPatch, noise: float, near: float
) -> None:
    """From a point far from it, as long as steps exceed what noise does; none without given speeds."""
    triangle = TRIANGLE.copy()
    triangle[-1, -1] = noise

    def fit(job: Any, kernel: Any, point: np.ndarray, sampled: bool = False) -> Any:
        assert sampled
        block, left = SimpleNamespace(count=100), 1.0 + float(np.linalg.norm(point - GOAL))
        return SimpleNamespace(
            columns=NAMES, triangle=triangle, count=100, blocks=(block,), residual_norms=(left,)
        )

    monkeypatch.setattr(given_positions, "_fit", fit)
    monkeypatch.setattr(given_positions, "_moved", lambda *at: GOAL + 0.5 * (at[-1] - GOAL))
    kernel: Any = Kernel()
    start = Rest(GOAL + np.array([0.6, -0.4, 0.8]), np.zeros(3), 0.0)
    assert given_positions._near_its_estimate(JOB, kernel, start) is start
    kernel.speeds = ("motor",)
    found = given_positions._near_its_estimate(JOB, kernel, start)
    assert np.linalg.norm(found.point - GOAL) < near
    assert np.array_equal(found.point, start.point) is (noise > 1.0)


def test_noise_moves_the_estimate_by_the_sum_of_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The deviation of a fit, and what follows through the point, against the solved linear equation."""
    rest, _ = rested(monkeypatch, (0.86, 1e-3, -1e-3))
    noise = np.linalg.inv(TRIANGLE[:3, :3].T @ TRIANGLE[:3, :3])
    monkeypatch.setattr(given_positions, "hac_covariance", lambda fit: noise)
    solved = np.linalg.inv(np.eye(3) - map_of((0.86, 0.0, 0.0)))
    assert rest is not None
    wanted = solved @ noise @ solved.T
    np.testing.assert_allclose(noise + rest.drift(FIT, MODEL), wanted, atol=0.03 * np.abs(wanted).max())
    still = Rest(GOAL, np.array([1.0, 0.0, 0.0]), 0.0)
    assert not np.any(still.drift(FIT, MODEL))
