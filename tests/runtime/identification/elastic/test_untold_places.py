"""Places that tell not every spring: where they are taken, and what is uncertain beside such a spring."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification import given_positions
from modelgen.runtime.identification.elastic import rest as rest_of_steps
from modelgen.runtime.identification.elastic.rest import Rest
from modelgen.runtime.model.deflected_kernel import DeflectedKernel

NAMES = ("K", "M", "D")
GOAL = np.array([3.0, 1.0, 2.0])
ROWS = np.array([[2.0, 1.0, 0.5], [0.0, 3.0, 1.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(("found", "taken"), [(None, "untold"), (10.0, "untold"), (1.0, "found")])
def test_a_place_that_tells_not_every_spring_may_be_the_likelier_one(
    monkeypatch: pytest.MonkeyPatch, found: float | None, taken: str
) -> None:
    """Of a slide in slow motion it was refused, and rows ended at a rotor of negative inertia."""
    monkeypatch.setattr(given_positions, "_misfit", lambda task: (task, True))
    told: Any = None if found is None else (found, "found")
    untold: Any = (0.0, "untold")
    assert given_positions._likelier(told, untold)[1] == taken  # type: ignore[comparison-overlap]


@pytest.mark.parametrize(
    ("told", "possible", "better", "taken"),
    [
        (True, True, True, True),
        (False, True, True, False),
        (True, False, True, False),
        (True, True, False, False),
    ],
)
def test_higher_cutoffs_are_taken_for_a_spring_if_they_tell_all_better(
    monkeypatch: pytest.MonkeyPatch, told: bool, possible: bool, better: bool, taken: bool
) -> None:
    near: Any = ("near", Rest(GOAL, np.zeros(3), 0.0, held=("tau_1",), told=False))
    higher = "higher", Rest(-GOAL, np.zeros(3), 0.0, told=told)
    monkeypatch.setattr(given_positions, "higher_cutoffs", lambda task, most: ["higher"])
    monkeypatch.setattr(given_positions, "_on_time", lambda task: None)
    monkeypatch.setattr(given_positions, "_at_rest", lambda *at, others: higher)
    monkeypatch.setattr(given_positions, "_misfit", lambda task: (0.0, possible))
    monkeypatch.setattr(given_positions, "_digits", lambda task: float(better and task == "higher"))
    kernel: Any = None
    found: Any = given_positions._told_higher(*near, kernel)
    assert (found[0] == "higher") == taken
    assert found[1].held == ("tau_1",)


@pytest.mark.parametrize(("percent", "widened"), [(10.0, 1.0), (30.0, 1.0 / 0.412), (90.0, 10.0)])
def test_what_follows_an_untold_spring_is_as_uncertain_as_its_compliance(
    monkeypatch: pytest.MonkeyPatch, percent: float, widened: float
) -> None:
    """A rotor in front of a spring known to 29 % was 5.2 deviations off beside it."""
    along = np.array([0.01 * percent * GOAL[0], -0.9, 0.0])
    covariance = np.outer(along, along) + np.diag([0.0, 0.04, 0.01])
    monkeypatch.setattr(rest_of_steps, "hac_covariance", lambda fit: covariance)
    kernel = object.__new__(DeflectedKernel)
    object.__setattr__(kernel, "point", GOAL)
    giving = SimpleNamespace(acting=lambda order: (0,) if order == 0 else (2,))
    object.__setattr__(kernel, "giving", (giving,))
    triangle = np.column_stack([ROWS, ROWS @ GOAL])
    fit: Any = SimpleNamespace(columns=NAMES, triangle=triangle, solution=SimpleNamespace(x=GOAL))
    model: Any = SimpleNamespace(base_parameters=NAMES, kernel=kernel)
    drift = Rest(GOAL, np.zeros(3), 0.0).drift(fit, model)
    np.testing.assert_allclose(drift, (widened**2 - 1.0) * np.outer(along, along), atol=1e-12)
