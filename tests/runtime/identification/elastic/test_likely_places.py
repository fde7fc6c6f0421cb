"""Springs of unlike ratios: where starts of one share do not explain the rows, scattered ones are tried."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic import likely_places as places
from modelgen.runtime.identification.elastic.starting_springs import scattered_springs
from modelgen.runtime.identification.thresholds import SCATTERED, SCATTERED_STARTS
from modelgen.runtime.records.record import Record

FORCE_AND_MOTION = (((1.0, "tau"),), ((1.0, "q"),))


def row(column: int) -> Any:
    return SimpleNamespace(acting=lambda order: (column,) if order == 0 else (), size=FORCE_AND_MOTION)


KERNEL: Any = SimpleNamespace(
    giving=(row(0), row(1)), reads_of={key: (key, 0) for key in ("tau", "q")}, motors_alone=True
)
MODEL: Any = SimpleNamespace(base_parameters=("K_1", "K_2"), parameter_sets={})
# a force of 100 at a motion of 1: springs of 100 deflect as much as the motor moves
LINE = np.linspace(0.0, 1.0, 50)
JOB: Any = SimpleNamespace(model=MODEL, records=(Record({"tau": 100.0 * LINE, "q": LINE}, 100.0, "r"),))
# the second spring is in the band of the motion, and deflects by more than that
GOAL, RIGID = np.array([5000.0, 60.0]), np.array([4000.0, 1e30])


def test_starts_are_spread_over_all_ratios_of_springs() -> None:
    shares = np.array([100.0 / point for point in scattered_springs(MODEL, KERNEL, JOB.records)])
    assert np.all((shares >= SCATTERED[0]) & (shares <= SCATTERED[1]))
    cell = (3.0 * np.log(shares / SCATTERED[0]) / np.log(SCATTERED[1] / SCATTERED[0])).astype(int)
    assert len({tuple(one) for one in cell.tolist()}) == 9


@pytest.mark.parametrize("explained", [False, True])
def test_a_spring_in_the_band_is_found_from_scattered_starts(
    monkeypatch: pytest.MonkeyPatch, explained: bool
) -> None:
    tried: list[np.ndarray] = []

    def led(job: Any, kernel: Any, starts: Any) -> list[np.ndarray]:
        """Steps reach the goal from within a factor of three in the springs' ratio; else one is rigid."""
        begun = list(starts)
        tried.extend(begun)
        near = [abs(np.log(one[0] / one[1] * GOAL[1] / GOAL[0])) < np.log(3.0) for one in begun]
        return [GOAL] if any(near) else [RIGID]

    monkeypatch.setattr(places, "settled", led)
    monkeypatch.setattr(places, "likely_starts", lambda job, kernel, starts: list(starts))
    monkeypatch.setattr(places, "explains", lambda job, kernel, point: explained)
    monkeypatch.setattr(places, "_left", lambda job, kernel, point: 0.0 if point is GOAL else 4.0)
    search = places.StartedSprings(JOB, KERNEL)
    search.places(scattered=False)
    found = search.places()
    if explained:  # what explains the rows needs no further starts
        assert len(tried) == 5
        assert found[0] is RIGID
    else:
        # steps from the first ones are taken once
        assert len(tried) == 5 + SCATTERED_STARTS
        assert found[0] is GOAL
        assert found[1] is RIGID


def test_one_spring_has_no_other_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "settled", lambda job, kernel, starts: [RIGID])
    monkeypatch.setattr(places, "explains", lambda job, kernel, point: False)
    one = SimpleNamespace(**{**vars(KERNEL), "giving": (row(0),)})
    (found,) = places.StartedSprings(JOB, one).places()
    assert found is RIGID
