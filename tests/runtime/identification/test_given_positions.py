"""Steps to the point about which rows are linear: where they come to rest, and what noise does to that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification import given_positions
from modelgen.runtime.identification.elastic import rest as rest_of_steps
from modelgen.runtime.identification.elastic import steps_about
from modelgen.runtime.identification.elastic.rest import Rest
from modelgen.runtime.identification.thresholds import POINT_TOLERANCE, TOLD_APART
from modelgen.runtime.model.deflected_kernel import DeflectedKernel

NAMES = ("K", "M", "D")
MODEL: Any = SimpleNamespace(base_parameters=NAMES, kernel=None)
CHOICE = SimpleNamespace(dynamics_hz=5.0, cutoff_hz=20.0)
JOB: Any = SimpleNamespace(model=MODEL, choice=CHOICE, records=())
GOAL = np.array([3.0, 1.0, 2.0])
TRIANGLE = np.array([[2.0, 1.0, 0.5, 0.0], [0.0, 3.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
FIT: Any = SimpleNamespace(columns=NAMES, triangle=TRIANGLE)


class Kernel:
    """One that never refuses a point."""

    giving = ()
    speeds: tuple[str, ...] = ()
    motors_alone = False

    def at(self, _: np.ndarray, sampled: bool = False) -> Kernel:
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
    monkeypatch.setattr(rest_of_steps, "fit_about", lambda job, kernel, point: fits.append(point) or FIT)
    monkeypatch.setattr(rest_of_steps, "moved", lambda *at: GOAL + step @ (at[-1] - GOAL))
    kernel: Any = Kernel()
    return rest_of_steps.rested(JOB, kernel, GOAL + np.array([0.3, -0.2, 0.4])), len(fits)


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


def opened(monkeypatch: pytest.MonkeyPatch, noise: float, step: float) -> list[np.ndarray]:
    """Make rows with open forces whose steps go by so much of the way; return what collects their points.

    They leave less near the goal, most half a unit from it, and again less far away, as of forces that are
    open at more samples.
    """
    triangle, points = TRIANGLE.copy(), []
    triangle[-1, -1] = noise

    def fit(job: Any, kernel: Any, point: np.ndarray, sampled: bool = False) -> Any:
        assert sampled
        points.append(point)
        far = float(np.linalg.norm(point - GOAL))
        block = SimpleNamespace(count=1000, opened=0.0 if far < 1.0 else 500.0)
        left = (1.0 + far) * np.sqrt(block.count - block.opened)
        return SimpleNamespace(
            columns=NAMES, triangle=triangle, count=1000, blocks=(block,), residual_norms=(left,)
        )

    monkeypatch.setattr(steps_about, "_tells_springs", lambda *of: True)
    monkeypatch.setattr(steps_about, "fit_about", fit)
    monkeypatch.setattr(steps_about, "moved", lambda *at: at[-1] + step * (GOAL - at[-1]))
    return points


@pytest.mark.parametrize("step", [0.5, 1.0, 2.2, 2.6])
def test_rows_with_open_forces_rest_at_their_own_estimate(
    monkeypatch: pytest.MonkeyPatch, step: float
) -> None:
    """Also where steps go too far, and others of several starts lead nowhere."""
    opened(monkeypatch, 1.0, step)
    kernel: Any = Kernel()
    starts = [GOAL + by * np.array([0.6, -0.4, 0.8]) for by in (3.0, 0.5, 1.0)]
    found = steps_about.rest_with_forces_open(JOB, kernel, starts)
    assert found is not None
    assert np.linalg.norm(found.point - GOAL) < 5e-3


def test_steps_within_the_noise_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    points = opened(monkeypatch, 100.0, 0.5)
    kernel: Any = Kernel()
    start = GOAL + np.array([0.06, -0.04, 0.08])
    assert steps_about.rest_with_forces_open(JOB, kernel, [start]) == (start, True)
    assert len(points) == 1


def test_open_forces_make_no_point_better(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the directions open leave the root of half as much: that is no nearer to the estimate."""
    opened(monkeypatch, 1e-3, -0.5)
    kernel: Any = Kernel()
    start = GOAL + np.array([0.4, -0.4, 0.4])
    assert steps_about.rest_with_forces_open(JOB, kernel, [start]) is None
    assert steps_about.rest_with_forces_open(JOB, kernel, [start], anyway=True) == (start, True)


@pytest.mark.parametrize("told", [True, False])
def test_steps_within_the_noise_that_go_to_and_fro_come_to_rest(
    monkeypatch: pytest.MonkeyPatch, told: bool
) -> None:
    """Which forces are open changed with the point: two places led to each other for ever."""
    opened(monkeypatch, 1.0, 1.0)
    monkeypatch.setattr(steps_about, "_tells_springs", lambda *of: told)
    apart = np.array([0.006, 0.0, 0.0])

    def to_and_fro(*at: Any) -> np.ndarray:
        return np.asarray(GOAL - np.sign(at[-1][0] - GOAL[0] - 1e-3) * apart)

    monkeypatch.setattr(steps_about, "moved", to_and_fro)
    kernel: Any = Kernel()
    found = steps_about.rest_with_forces_open(JOB, kernel, [GOAL + 0.1])
    assert found is not None
    assert found.told == told
    assert np.linalg.norm(found.point - GOAL) < 0.02


def test_noise_moves_the_estimate_by_the_sum_of_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The deviation of a fit, and what follows through the point, against the solved linear equation."""
    rest, _ = rested(monkeypatch, (0.86, 1e-3, -1e-3))
    noise = np.linalg.inv(TRIANGLE[:3, :3].T @ TRIANGLE[:3, :3])
    monkeypatch.setattr(rest_of_steps, "hac_covariance", lambda fit: noise)
    solved = np.linalg.inv(np.eye(3) - map_of((0.86, 0.0, 0.0)))
    assert rest is not None
    wanted = solved @ noise @ solved.T
    np.testing.assert_allclose(noise + rest.drift(FIT, MODEL), wanted, atol=0.03 * np.abs(wanted).max())
    still = Rest(GOAL, np.array([1.0, 0.0, 0.0]), 0.0)
    assert not np.any(still.drift(FIT, MODEL))


@pytest.mark.parametrize(
    ("left", "sets_right", "held", "beyond"),
    [
        ((0.0, -10.0), True, True, 0),
        ((0.0, -1.0), True, False, 1),
        ((0.0, 1.0), True, False, 1),
        ((0.0, 10.0), True, False, 0),
        ((0.0, -10.0), False, False, 0),
        # links of negative inertia are no explanation
        ((0.0, np.inf), True, False, 0),
        ((np.inf, 5.0), True, True, 0),
        ((np.inf, np.inf), True, False, 0),
    ],
)
def test_springs_are_sought_behind_held_commands(
    monkeypatch: pytest.MonkeyPatch, left: tuple[float, float], sets_right: bool, held: bool, beyond: int
) -> None:
    """Half a sample of a held command had springs of links' encoders refused, or 130 deviations off.

    Rows about the place behind holds, of records without, gave a rotor of negative inertia.
    """
    model = SimpleNamespace(actuators=(SimpleNamespace(key="tau_1"), SimpleNamespace(key="t_1")))
    behind: Any = SimpleNamespace(misfit=left[1], goal=GOAL, model=model)
    plain: Any = SimpleNamespace(misfit=left[0], goal=-GOAL, model=model, sets_channels_right=sets_right)
    plain.changed = lambda change: behind if change.keywords == {"channels": ("tau_1",)} else None
    monkeypatch.setattr(given_positions, "_on_time", lambda task: None)
    monkeypatch.setattr(given_positions, "_misfit", lambda task: (task.misfit, True))
    monkeypatch.setattr(given_positions, "_explained", lambda task, rest, kernel: False)
    monkeypatch.setattr(
        given_positions, "_searched", lambda task, *_, **options: (task, Rest(task.goal, np.zeros(3), 0.0))
    )
    kernel: Any = Kernel()
    found = given_positions._about(plain, kernel)
    assert found is not None
    task, rest = found
    assert task is (behind if held else plain)
    assert rest.held == (("tau_1",) if held else ())
    assert len(rest.beyond) == beyond
    assert all(np.array_equal(one, 2.0 * GOAL) for one in rest.beyond)


@dataclass(frozen=True)
class GivenJob:
    leave_open: bool = True


@dataclass(frozen=True)
class Given:
    """A task whose commands are held or not, and whose rows leave forces open or not."""

    commands: str
    job: GivenJob = GivenJob()
    sets_channels_right: bool = True

    @property
    def model(self) -> SimpleNamespace:
        return SimpleNamespace(actuators=(SimpleNamespace(key="tau_1"),))

    def changed(self, _: object) -> Given:
        return replace(self, commands="held")


@pytest.mark.parametrize(
    ("only", "closed", "commands", "left_open"),
    [
        ("held", {"plain": 1.0, "held": 10.0}, "plain", False),
        ("held", {"plain": 10.0, "held": 1.0}, "held", True),
        ("held", {"held": 1.0}, "held", True),
        ("plain", {"plain": 10.0, "held": 1.0}, "held", False),
        ("plain", {"plain": 1.0, "held": 10.0}, "plain", True),
    ],
)
def test_steps_that_do_not_rest_say_nothing_of_commands(
    monkeypatch: pytest.MonkeyPatch, only: str, closed: dict[str, float], commands: str, left_open: bool
) -> None:
    """Motors alone in fast motion: as rows without holds did not rest, friction was 20 deviations off."""

    def near(task: Given, job: GivenJob, _: object, points: Sequence[Any]) -> Any:
        assert not job.leave_open and points == (GOAL,)
        return (task, Rest(GOAL, np.zeros(3), 0.0)) if task.commands in closed else None

    def both(task: Given, held: Given, _: object) -> tuple[Any, ...]:
        rest = Rest(GOAL, np.zeros(3), 0.0)
        return tuple((one, rest) if one.commands == only else None for one in (task, held))

    monkeypatch.setattr(given_positions, "_with_and_without_holds", both)
    monkeypatch.setattr(given_positions, "_at_rest", near)
    monkeypatch.setattr(given_positions, "_on_time", lambda task: task.job)
    monkeypatch.setattr(given_positions, "_misfit", lambda task: (closed[task.commands], True))
    given: Any = Given("plain")
    kernel: Any = Kernel()
    found: Any = given_positions._about(given, kernel)
    assert (found[0].commands, found[0].job.leave_open) == (commands, left_open)
    assert found[1].held == (("tau_1",) if commands == "held" else ())


@pytest.mark.parametrize("through_noise", [False, True])
def test_what_is_negative_through_noise_says_nothing_of_a_place(
    monkeypatch: pytest.MonkeyPatch, through_noise: bool
) -> None:
    """A damper of which nearly all was noise had places refused that explain the rows.

    Nor is another one a reason to take any place instead: rows of held commands that left far more hid the
    damper, were taken, and commands were said to be held that no drive held.
    """
    fit, freed = SimpleNamespace(count=3), SimpleNamespace(count=3)
    monkeypatch.setattr(given_positions, "_on_time", lambda task: task.job)
    monkeypatch.setattr(given_positions, "run_wls", lambda job: (None, fit))
    monkeypatch.setattr(given_positions, "less_noise", lambda *_: (freed, None))
    monkeypatch.setattr(given_positions, "left_by", lambda one: 2.0)
    monkeypatch.setattr(given_positions, "impossible", lambda model, one: one is fit or not through_noise)
    job = SimpleNamespace(records=(), choice=None)
    task: Any = SimpleNamespace(model=None, job=job)
    expected = (6.0, True) if through_noise else (6.0 + TOLD_APART, False)
    assert given_positions._misfit(task) == expected


@pytest.mark.parametrize("explained", [False, True])
def test_more_starts_are_tried_where_neither_hold_nor_none_explains(
    monkeypatch: pytest.MonkeyPatch, explained: bool
) -> None:
    searched: list[tuple[str, bool]] = []
    known: dict[str, Any] = {}

    def search(task: Any, within: Any, scattered: bool = True) -> tuple[Any, Rest]:
        searched.append((task, scattered))
        assert known.setdefault(task, within) is within, "what led nowhere is not looked for again"
        return task, Rest(GOAL, np.zeros(3), 0.0)

    monkeypatch.setattr(given_positions, "_on_time", lambda task: task)
    monkeypatch.setattr(given_positions, "_searched", search)
    monkeypatch.setattr(given_positions, "_explained", lambda task, *_: explained and task == "held")
    given: Any = given_positions._with_and_without_holds
    given("plain", "held", SimpleNamespace(giving=(1, 2)))
    few = [("plain", False), ("held", False)]
    assert searched == few + ([] if explained else [("plain", True), ("held", True)])


def test_an_estimate_away_from_where_its_rows_are_linear_is_as_uncertain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A fit 180 deviations away from its point had intervals of its noise alone."""
    monkeypatch.setattr(rest_of_steps, "hac_covariance", lambda fit: np.eye(3))
    kernel = object.__new__(DeflectedKernel)
    object.__setattr__(kernel, "point", GOAL)
    object.__setattr__(kernel, "giving", ())
    model: Any = SimpleNamespace(base_parameters=NAMES, kernel=kernel)
    for away, wanted in ((2.0, 0.0), (180.0, 180.0**2)):
        triangle = TRIANGLE.copy()
        triangle[:3, 3] = TRIANGLE[:3, :3] @ (GOAL + np.array([away, 0.0, 0.0]))
        fit: Any = SimpleNamespace(columns=NAMES, triangle=triangle)
        assert Rest(GOAL, np.zeros(3), 0.0).drift(fit, model)[0, 0] == pytest.approx(wanted)


def test_rows_beyond_all_numbers_are_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far from an estimate a triangle may not be finite: that had ended in an error of NumPy."""

    def fails(job: Any) -> Any:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(steps_about, "run_wls", fails)
    monkeypatch.setattr(steps_about, "replace", lambda one, **changes: one)
    kernel: Any = Kernel()
    with pytest.raises(IdentifiabilityError, match="beyond all numbers"):
        steps_about.fit_about(JOB, kernel, GOAL)
