"""How many noisy copies of an experiment are estimated from: few where they leave most parameters open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from modelgen.runtime.planning import predicted_precision
from modelgen.runtime.planning.thresholds import FEW_COPIES, FIRST_COPIES
from tests.runtime.iv.physical.test_composite_iv import motor_only


def copies(monkeypatch: pytest.MonkeyPatch, given: tuple[str, ...]) -> int:
    """Return how many copies are estimated from where each gives these parameters."""
    tried: list[int] = []

    def estimated(_: Any, seed: int) -> Any:
        tried.append(seed)
        return SimpleNamespace(physical=dict.fromkeys(given, 1.0))

    monkeypatch.setattr(predicted_precision, "estimate_once", estimated)
    planned: Any = SimpleNamespace(model=motor_only("emps300"))
    found = predicted_precision._first_copies(planned)
    assert len(found) == len(tried) == len(set(tried))
    return len(found)


def test_an_experiment_that_leaves_most_parameters_open_takes_few_copies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = motor_only("emps300").parameters
    assert copies(monkeypatch, every[:1]) == FEW_COPIES
    assert copies(monkeypatch, every) == FIRST_COPIES
