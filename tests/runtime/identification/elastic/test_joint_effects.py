"""Effects that are taken up one by one: none that makes all rows together less likely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic import aligned_channels, channels_set_right, joint_effects
from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.identification.elastic.encoder_zeros import encoder_zeros
from modelgen.runtime.identification.elastic.force_gains import force_gains
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import delay_effect
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record
from tests.runtime.identification.elastic.test_channels_set_right import FS, made

MODEL = made()[0]
GAIN, LATE = next(iter(force_gains(MODEL))), delay_effect("tau_1")


class Rows:
    """Rows in which the gain explains most in weighted squares; `worse` is what it adds to the misfit."""

    def __init__(self, effects: Sequence[Effect], worse: float) -> None:
        self.effects, self.worse = tuple(effects), worse
        self.job = SimpleNamespace(model=MODEL, records=())

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


@pytest.mark.parametrize(
    ("better", "size", "taken"), [(500.0, 0.03, True), (20.0, 0.03, False), (500.0, 0.01, False)]
)
def test_a_gain_with_which_rows_are_far_likelier_is_taken(
    monkeypatch: pytest.MonkeyPatch, better: float, size: float, taken: bool
) -> None:
    """Noise of a link's accelerations hid a torque constant 5 % off: a stiffness was 192 deviations off."""
    monkeypatch.setattr(joint_effects, "_shown", lambda *of: iter(()))
    monkeypatch.setattr(joint_effects.JointEffects, "_spread", property(lambda self: np.array([0.004])))
    monkeypatch.setattr(joint_effects.JointEffects, "_pulled", lambda self, place: 0.0)
    rows: Any = Rows((GAIN,), -better)
    solved = rows.solved

    def sized(effects: Sequence[Effect]) -> Any:
        fit = solved(effects)
        fit.solution = SimpleNamespace(x=np.full(len(effects), size))
        return fit

    rows.solved = sized
    assert (joint_effects.joint_effects(rows, (), rests=True).effects == (GAIN,)) == taken
    assert not joint_effects.joint_effects(rows, (), rests=False).effects


def test_what_misleads_zeros_misleads_the_rest_as_well() -> None:
    """Rows of links weigh less than their noise asks for: stiffnesses scattered by 1.3 of what was stated."""
    model, read, _ = made()
    read = {key: samples[:2000] for key, samples in read.items()}
    job = prepared(model, [Record(read, FS)], WLS(), Filters(cutoff_hz=12.0), CheckOptions()).job
    rows = EffectRows(job, zeros := tuple(encoder_zeros(model, 1)))
    fit = rows.solved(zeros)
    joint = joint_effects.JointEffects(fit, zeros, rows)
    right, plain = joint.told(dict.fromkeys(zeros, 0.0)), rows.solved(())
    own, alone = np.diag(hac_covariance(plain)), np.diag(replace(right, shared=None).drift(plain))
    whole = np.diag(hac_covariance(fit))[: len(own)]
    # the parameters of a fit with the sizes scatter by this, whatever they have in common with these
    assert np.max(whole / (own + alone)) > 1.4
    assert np.max(whole / (own + np.diag(right.drift(plain)))) < 1.1


def test_what_rows_are_far_likelier_with_is_not_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    def rows_of(job: float, effects: Any) -> Any:
        return SimpleNamespace(solved=lambda sizes: SimpleNamespace(misfit=job))

    monkeypatch.setattr(channels_set_right, "EffectRows", rows_of)
    now, known = SimpleNamespace(model=MODEL), {GAIN: 0.03, LATE: 1e-3}
    for left, likelier in ((500.0, True), (20.0, False)):
        undone: list[Any] = []

        def corrected(
            task: Any, sizes: Any, model: Any, undone: list[Any] = undone, left: float = left
        ) -> Any:
            undone.append(sizes)
            return SimpleNamespace(job=left)

        monkeypatch.setattr(channels_set_right, "_corrected", corrected)
        given: Any = (GAIN, None, now, rows_of(0.0, ()), known)
        assert channels_set_right._likelier_with(*given) == likelier
        assert undone == [{LATE: 1e-3}]


def test_what_stood_in_for_another_one_is_said_in_its_place() -> None:
    """A turned accelerometer was forgotten beside an encoder's zero, which is the same: 45 deviations."""
    model, read, _ = made()
    job = prepared(model, [Record(read, FS)], WLS(), Filters(cutoff_hz=60.0), CheckOptions()).job
    other = replace(LATE, name="another", words="another cause", negative="another cause")
    rows = EffectRows(job, (other, LATE)).without(other)
    assert rows.effects == (LATE,)
    assert rows.every == (LATE, other)
    right = joint_effects.JointEffects(rows.solved((LATE,)), (LATE,), rows).told({LATE: 1e-3})
    assert [one.effect for one in right.others[0]] == [other]
    (said,) = right.advice
    assert "tau_1 is late by 1e+03 us" in said.what
    assert "or another cause by 1e+03 us: the intervals hold for either" in said.what
    alone = EffectRows(job, (LATE,))
    assert not joint_effects.JointEffects(alone.solved((LATE,)), (LATE,), alone).told({LATE: 1e-3}).others[0]


def test_noise_pulls_rows_with_the_weights_of_their_fit() -> None:
    """What half a sample of a force left had its row weigh an eighth, and gains seemed free of noise."""
    model, read, _ = made()
    late = {key: np.roll(read[key], 4) for key in ("tau_1", "tau_2")}
    job = prepared(model, [Record(read | late, FS, "late")], WLS(), Filters(), CheckOptions()).job
    delays = tuple(delay_effect(key) for key in late)
    rows = EffectRows(job, delays)
    alone, beside = rows.solved(()), rows.solved(delays)
    row = [block.row_name for block in alone.blocks].index("1 spring")
    more = (beside.weights[row] / alone.weights[row]) ** 2
    assert more > 2.0
    before, after = (float(rows.pull(fit, ["Ia1"])[0]) for fit in (alone, beside))
    assert after / before == pytest.approx(more, rel=0.1)


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
