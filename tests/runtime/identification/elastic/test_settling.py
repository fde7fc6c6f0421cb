"""Steps from springs far off: to where rows leave least, others held, nothing lost that rows do not show."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic import other_springs as others
from modelgen.runtime.identification.elastic import settling, steps_about
from modelgen.runtime.identification.elastic.settling import settled
from modelgen.runtime.identification.elastic.starting_springs import most_deflected
from modelgen.runtime.records.record import Record

NAMES = ("K", "M")
MODEL: Any = SimpleNamespace(base_parameters=NAMES)
CHOICE = SimpleNamespace(dynamics_hz=5.0, cutoff_hz=20.0)
JOB: Any = SimpleNamespace(model=MODEL, choice=CHOICE, records=())
GOAL = np.array([40.0, 2.0])
COUNT = 400


FORCE_AND_MOTION = (((30.0, "tau"),), ((1.0, "q"),))
READS_OF = {key: (key, 0) for key in ("tau", "q")}


class Kernel:
    """One spring, in column 0, without a damper."""

    giving = (SimpleNamespace(acting=lambda order: (0,) if order == 0 else (), size=FORCE_AND_MOTION),)
    reads_of = READS_OF
    columns = (0,)
    motors_alone = True

    def spring(self, row: object) -> tuple[float, float]:
        """It does not lag."""
        return 1.0, 0.0

    def at(self, _: np.ndarray, sampled: bool = False) -> Kernel:
        return self


KERNEL: Any = Kernel()


def rows(point: np.ndarray) -> np.ndarray:
    """Return what rows hold: a compliance that bends them, and a mass."""
    t = np.linspace(0.0, 1.0, COUNT)
    return (
        point[1] * (np.sin(7.0 * t) + np.sin(2.0 + 30.0 * t) / (1.0 + point[0])) + np.tanh(3.0 * t) / point[0]
    )


def fits(noise: float) -> Any:
    """Return what makes a fit of rows that are linear about a point, with noise."""
    measured = rows(GOAL) + noise * np.random.default_rng(1).standard_normal(COUNT)

    def fit(job: Any, kernel: Any, point: np.ndarray, sampled: bool = False) -> Any:
        steps = 1e-6 * np.abs(point) + 1e-9
        W = np.array([(rows(point + s) - rows(point - s)) / (2.0 * s.sum()) for s in np.diag(steps)]).T
        Y = measured - rows(point) + W @ point
        triangle = np.linalg.qr(np.column_stack([W, Y]))[1]
        x, *_ = np.linalg.lstsq(W, Y, rcond=None)

        def left(values: np.ndarray) -> float:
            return float(np.linalg.norm(Y - W @ values))

        summary = SimpleNamespace(residual_norm=left)
        return SimpleNamespace(
            columns=NAMES,
            triangle=triangle / noise,
            count=COUNT,
            blocks=(SimpleNamespace(count=COUNT, opened=0.0, summary=summary),),
            solution=SimpleNamespace(x=x),
            covariance=noise**2 * np.linalg.inv(W.T @ W),
        )

    return fit


def made(monkeypatch: pytest.MonkeyPatch, noise: float) -> Any:
    fit = fits(noise)
    for module in (steps_about, others):
        monkeypatch.setattr(module, "fit_about", fit)
    monkeypatch.setattr(others, "hac_covariance", lambda one: one.covariance)
    return fit


@pytest.mark.parametrize("start", [0.3, 2.0, 900.0, 2e4])
def test_rows_leave_least_at_the_goal_from_everywhere(monkeypatch: pytest.MonkeyPatch, start: float) -> None:
    made(monkeypatch, 1e-3)
    (found,) = settled(JOB, KERNEL, [np.array([start, 0.0])])
    np.testing.assert_allclose(found, GOAL, rtol=0.05)


def test_starts_that_agree_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    made(monkeypatch, 1e-3)
    tried = []

    def starts() -> Any:
        for stiffness in (30.0, 50.0, 1e-3, 1e6):
            tried.append(stiffness)
            yield np.array([stiffness, 0.0])

    assert len(settled(JOB, KERNEL, starts())) == 1
    assert tried == [30.0, 50.0]


def test_a_spring_that_gives_way_carries_no_link() -> None:
    record: Any = Record({"tau": np.linspace(-1.0, 1.0, 9), "q": np.linspace(0.0, 0.5, 9)}, 1e3, "run")
    job: Any = SimpleNamespace(model=MODEL, choice=CHOICE, records=(record,))
    # 60 N m on a motion of 0.5 rad
    assert most_deflected(KERNEL, job.records, np.array([40.0, 2.0])) == pytest.approx(3.0)
    assert steps_about.springs_hold(job, KERNEL, np.array([40.0, 2.0]))
    assert not steps_about.springs_hold(job, KERNEL, np.array([1.0, 2.0]))


def test_what_is_held_stays_where_it_is() -> None:
    """To leave its column out would take it to zero: rows are linear about the point."""
    point = np.array([25.0, 0.0])
    values = steps_about.held_values(fits(1e-6)(JOB, KERNEL, point), MODEL, point, {0})
    best = np.linalg.lstsq(
        rows(np.array([25.0, 1.0]))[:, None] - rows(point)[:, None], rows(GOAL) - rows(point), rcond=None
    )[0]
    assert values[0] == 25.0
    np.testing.assert_allclose(values[1], best, rtol=1e-4)


def test_the_change_is_the_smallest_where_rows_do_not_tell() -> None:
    """Two inertias of which rows see the sum: both change, and none is taken to zero."""
    triangle = np.array([[2.0, 2.0, 14.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    fit: Any = SimpleNamespace(columns=NAMES, triangle=triangle)
    values = steps_about.held_values(fit, MODEL, np.array([3.0, 2.0]))
    np.testing.assert_allclose(values, [4.0, 3.0])


@pytest.mark.parametrize(("noise", "told"), [(1e-4, True), (0.1, False)])
def test_a_spring_whose_profile_is_flat_is_uncertain_by_that(
    monkeypatch: pytest.MonkeyPatch, noise: float, told: bool
) -> None:
    """Deflections tell a compliance, of which zero is within the noise: any stiffer spring is as likely."""
    fit = made(monkeypatch, noise)
    place = settling.settled_with(JOB, KERNEL, np.array([40.0, 2.0]), (), 20)
    assert place is not None
    better, beyond = others.other_springs(JOB, KERNEL, place.point)
    assert better is None
    std = float(np.sqrt(fit(JOB, KERNEL, place.point).covariance[0, 0]))
    if told:
        assert not beyond
    else:
        ((change,),) = [one[:1] for one in beyond]
        assert abs(change) > std


def test_a_more_likely_place_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    made(monkeypatch, 0.02)
    monkeypatch.setattr(others, "LITTLE_KNOWN", 0.0)
    better, _ = others.other_springs(JOB, KERNEL, np.array([6.0, 2.0]))
    assert better is not None
    assert better[0] > 6.0


def test_what_rows_hardly_show_begins_even(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two inertias rows show the sum 100 times better: springs far off made one of them negative."""
    model: Any = SimpleNamespace(base_parameters=("Ia", "I"))
    job: Any = SimpleNamespace(model=model, choice=JOB.choice)
    W = np.array([[1.0, 1.0], [0.01, -0.01]])
    Y = W @ np.array([7.0, -3.0])
    triangle = np.vstack([np.column_stack([W, Y]), [0.0, 0.0, 1.0]])
    fit: Any = SimpleNamespace(columns=model.base_parameters, triangle=triangle)
    monkeypatch.setattr(settling, "tried", lambda *_: fit)
    kernel: Any = SimpleNamespace(columns=(0, 1), giving=())
    begun = settling._begun(job, kernel, np.zeros(2), ())
    assert begun is not None
    np.testing.assert_allclose(begun, [2.0, 2.0])
    monkeypatch.setattr(settling, "tried", lambda *_: None)
    assert settling._begun(job, kernel, np.zeros(2), ()) is None
