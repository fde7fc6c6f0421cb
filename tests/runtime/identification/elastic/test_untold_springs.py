"""Stiffnesses that are known too little for an interval are refused, with what would tell them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic import untold_springs as untold
from modelgen.runtime.identification.thresholds import LARGEST_PERCENT
from modelgen.runtime.model.deflected_kernel import DeflectedKernel

NAMES = ("K_1", "D_1", "K_2", "D_2", "Ia_2")
VALUES = np.array([900.0, 1.0, 500.0, 2.0, 0.1])


class Springs(DeflectedKernel):
    """Two damped springs."""

    def __init__(self) -> None:
        giving = [
            SimpleNamespace(acting=lambda order, first=first: (first + order,) if order < 2 else ())
            for first in (0, 2)
        ]
        object.__setattr__(self, "giving", tuple(giving))


def told(
    monkeypatch: pytest.MonkeyPatch, percent: float, drift_percent: float = 0.0, refused: tuple[str, ...] = ()
) -> dict[str, str]:
    """Return what is refused where the second spring is known to so much, all else to 0.2 %."""
    std = 0.002 * VALUES
    std[2] = 0.01 * percent * VALUES[2]
    drift = np.zeros((5, 5))
    drift[2, 2] = (0.01 * drift_percent * VALUES[2]) ** 2
    monkeypatch.setattr(untold, "hac_covariance", lambda _: np.diag(std**2))
    fit: Any = SimpleNamespace(columns=NAMES, solution=SimpleNamespace(x=VALUES))
    model: Any = SimpleNamespace(kernel=Springs(), base_parameters=NAMES)
    return untold.untold_springs(fit, model, drift, refused)


def test_a_spring_that_is_hardly_told_has_no_number_nor_has_its_damper(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = told(monkeypatch, 3.0 * LARGEST_PERCENT)
    assert list(found) == ["K_2", "D_2"]
    assert "60 % of its value" in found["K_2"] and "other side of the spring" in found["K_2"]
    assert "K_2" in found["D_2"]


def test_no_damper_is_told_beside_a_spring_that_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rigid spring, which rows do not show, left -12074 +- 7 of a damper of 3."""
    assert [*told(monkeypatch, 0.2, refused=("K_2",))] == ["D_2"]


def test_what_settings_move_it_by_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not told(monkeypatch, 0.8 * LARGEST_PERCENT)
    assert told(monkeypatch, 0.8 * LARGEST_PERCENT, 0.8 * LARGEST_PERCENT)


def test_rows_that_hold_no_given_position_tell_stiffnesses() -> None:
    model: Any = SimpleNamespace(kernel=None)
    assert untold.untold_springs(SimpleNamespace(), model) == {}  # type: ignore[arg-type]
