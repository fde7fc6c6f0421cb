"""Effects that are taken up one by one: none that makes all rows together less likely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from modelgen.runtime.identification.elastic import aligned_channels, joint_effects
from modelgen.runtime.identification.elastic.force_gains import force_gains
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import delay_effect
from tests.runtime.identification.elastic.test_channels_set_right import made

MODEL = made()[0]
GAIN, LATE = next(iter(force_gains(MODEL))), delay_effect("tau_1")


class Rows:
    """Rows in which the gain explains most in weighted squares; `worse` is what it adds to the misfit."""

    def __init__(self, effects: Sequence[Effect], worse: float) -> None:
        self.effects, self.worse = tuple(effects), worse
        self.job = SimpleNamespace(model=MODEL)

    def solved(self, effects: Sequence[Effect]) -> Any:
        misfit = sum(self.worse if one is GAIN else -10.0 for one in effects)
        return SimpleNamespace(columns=tuple(one.name for one in effects), misfit=misfit)

    def without(self, effect: Effect) -> Rows:
        return Rows([one for one in self.effects if one is not effect], self.worse)


def shown(rows: Rows, fit: Any, chosen: Sequence[Effect]) -> Iterator[Any]:
    for effect, explained in ((GAIN, 0.05), (LATE, 0.03)):
        if effect in rows.effects and effect not in chosen:
            yield SimpleNamespace(effect=effect, explained=explained)


@pytest.mark.parametrize(("worse", "taken"), [(5.0, (LATE,)), (-5.0, (GAIN,))])
def test_what_makes_rows_less_likely_is_not_taken(
    monkeypatch: pytest.MonkeyPatch, worse: float, taken: tuple[Effect, ...]
) -> None:
    """Rows without a force weigh less than they say: noise of the others was told as a gain of 6 %."""
    monkeypatch.setattr(joint_effects, "_shown", shown)
    rows: Any = Rows((GAIN, LATE), worse)
    assert joint_effects.joint_effects(rows, (), rests=True).effects == taken


def test_tachometers_are_set_right_before_anything_else_is_looked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What they read of held commands was told as gravity that is askew by 4 degrees."""
    order: list[str] = []

    def set_right(task: Any, held: Any, measured: str) -> Any:
        order.append(measured)
        return task

    def looked(task: Any, again: Any, held: Any) -> tuple[Any, None]:
        order.append("looked")
        return task, None

    monkeypatch.setattr(aligned_channels, "with_speeds_of_positions", set_right)
    monkeypatch.setattr(aligned_channels, "with_channels_set_right", looked)
    task: Any = SimpleNamespace(sets_channels_right=True)
    assert aligned_channels.with_aligned_channels(task, None) == (task, None)
    assert order == ["velocity", "looked", "torque"]
