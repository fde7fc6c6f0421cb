"""Channels of an elastic arm that are late, held, off zero or behind another gear: named, and set right."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen import identify
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.identification.elastic import channels_set_right
from modelgen.runtime.identification.elastic.channel_errors import (
    Instead,
    SetRight,
    by_half,
    channel_errors,
    gears,
)
from modelgen.runtime.identification.elastic.joint_effects import Aligned, pulled_size
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.iv.model_errors import delay_effect, zero_effect
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import exact_record, geared, readings, two_link, values_of, with_sensors
from tests.symbolic.arms.test_elastic_rows import both

FS = 1000.0
OFF = {"late": 1.0, "held": -0.5, "early": -0.3}


@lru_cache(maxsize=2)
def exact(
    sides: tuple[str, ...] = ("motor", "link"),
    gears: bool = True,
) -> tuple[Model, dict[str, np.ndarray], dict[str, float]]:
    """Return a model with encoders on these sides, exact channels, and the true base parameters."""
    spec = with_sensors(two_link(), *(one for side in sides for one in both(side)))
    return exact_channels(geared(spec) if gears else spec, np.random.default_rng(3))


def exact_channels(
    spec: ArmSpec, rng: np.random.Generator
) -> tuple[Model, dict[str, np.ndarray], dict[str, float]]:
    """Return the model of an arm, exact channels, and the true base parameters."""
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set="s"))), "elastic")
    values = values_of(spec, rng)
    motion, forces = exact_record(spec, values, np.arange(0.0, 8.0, 1.0 / FS), rng, tempo=2.0)
    signals = readings(spec, motion, forces, "s")
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    truth = dict(zip(model.base_parameters, base.tolist(), strict=True))
    return model, {key: signals[key] for key in model.channels}, truth


def noisy(channels: dict[str, np.ndarray], gear: float = 30.0) -> dict[str, np.ndarray]:
    """Return what encoders and drives read, those of motors in front of such gears."""
    rng, sizes = np.random.default_rng(4), {"motor": 5e-6 * gear, "link": 5e-6, "tau": 0.05 / gear}
    return {
        key: samples + sizes[key.split("_")[0]] * rng.standard_normal(len(samples))
        for key, samples in channels.items()
    }


def made(
    sides: tuple[str, ...] = ("motor", "link"),
) -> tuple[Model, dict[str, np.ndarray], dict[str, float]]:
    """Return the same with noise."""
    model, channels, truth = exact(sides)
    return model, noisy(channels), truth


def estimated(model: Model, channels: dict[str, np.ndarray]) -> Estimate:
    return identify(model, Record(channels, FS, "arm"))


def told(estimate: Estimate) -> list[str]:
    return [one.what for one in estimate.checks.advice if one.kind == "more than the model"]


def errors(estimate: Estimate, truth: dict[str, float]) -> np.ndarray:
    """Return how far each parameter is off, in stated deviations, (parameters,)."""
    found = estimate.params
    return np.array([(found[name] - truth[name]) / estimate.bse[name] for name in found])


@pytest.mark.parametrize("case", ["late", "held", "early", "zero", "gear"])
def test_a_channel_that_is_off_is_named_and_set_right(case: str) -> None:
    model, read, truth = made()
    motor, link = "motor_position_1", "link_position_1"
    channel = {"late": "tau_1", "held": "tau_1", "early": link, "zero": motor, "gear": motor}[case]
    if case == "held":
        # the mean of a command over a sample is the force: it has more of what bends than the force
        read |= {channel: read[channel] - np.gradient(np.gradient(exact()[1][channel])) / 24.0}
    if case in OFF:
        moved = shift(channel, -OFF[case]).whole(read[channel])
    elif case == "zero":
        moved = read[channel] + 0.01
    else:
        moved = read[channel] / 1.01
    changed = read | {channel: moved}
    if case == "gear":
        changed["tau_1"] = 1.01 * read["tau_1"]
    estimate = estimated(model, changed)
    (said,) = told(estimate)
    assert channel in said
    wanted = {"late": "late by 1e+03 us", "held": "holds", "early": "early by 3", "gear": "(-0.99 %)"}
    assert wanted.get(case, "zero of its own (+0.0") in said
    late = {"late": 1e-3, "early": -3e-4}.get(case)
    assert dict(estimate.delays) == ({channel: pytest.approx(late, rel=0.1)} if late else {})
    assert all(0.0 < std < 1e-4 for std in estimate.delay_std.values())
    z = errors(estimate, truth)
    assert np.sqrt(np.mean(z**2)) < 1.5
    assert np.max(np.abs(z)) < 3.5


def test_what_hides_a_spring_is_found_at_the_spring_that_it_hides() -> None:
    model, read, truth = made()
    # least squares makes the spring many times too soft; the other motor moves both joints
    estimate = estimated(model, read | {"motor_position_1": read["motor_position_1"] + 15.0})
    (said,) = told(estimate)
    assert "motor_position_1 has a zero of its own (+15)" in said
    assert np.max(np.abs(errors(estimate, truth))) < 3.5
    # zeros of both motors are estimated: where it could have been either, links were known to 64 %
    assert estimate.bse["Izz1_R"] < 1e-3 * estimate.params["Izz1_R"]


def test_a_right_record_has_nothing_set_right() -> None:
    model, read, truth = made()
    estimate = estimated(model, read)
    assert not told(estimate)
    assert np.max(np.abs(errors(estimate, truth))) < 3.5


@pytest.mark.slow
@pytest.mark.parametrize("sides", [("motor",), ("link",)])
def test_a_late_force_is_set_right_where_springs_give_positions(sides: tuple[str, ...]) -> None:
    model, read, truth = made(sides)
    estimate = estimated(model, read | {"tau_1": shift("tau_1", -1.0).whole(read["tau_1"])})
    assert any("tau_1" in said or "_1 is early" in said for said in told(estimate))
    assert np.max(np.abs(errors(estimate, truth))) < 4.0


def test_where_both_sides_are_read_the_zero_of_the_link_is_that_of_the_arm() -> None:
    model = made()[0]
    names = {effect.name for effect in channel_errors(model)}
    wanted = {"zero of motor_position_1", "delay of link_position_1", "delay of tau_1"}
    assert wanted | {"gear of motor_position_1"} <= names
    assert "zero of link_position_1" not in names
    # the other motor moves two joints: its turns are those of no one gear
    assert gears(model) == {"motor_position_1": "tau_1"}


def test_only_drives_hold_their_commands() -> None:
    records: Any = (SimpleNamespace(fs=1000.0),)
    assert by_half(delay_effect("tau_1"), -5.1e-4, records)
    assert by_half(delay_effect("tau_1"), 1.55e-3, records)
    assert not by_half(delay_effect("tau_1"), 1e-3, records)
    assert not by_half(delay_effect("t_1"), -5e-4, records)


def test_commands_that_are_held_are_told_in_one_sentence() -> None:
    none = np.zeros((1, 0))
    right = SetRight(("K_1",), (), (), none, np.zeros((0, 0)), ("tau_1", "tau_2"))
    (said,) = right.advice
    assert "tau_1, tau_2 are commands which the drive holds" in said.what
    assert "--held tau_1 --held tau_2" in said.remedy


def test_drives_of_a_machine_are_likely_to_hold_alike_but_none_that_is_late() -> None:
    model, read, _ = made()
    early, late = delay_effect("tau_1"), delay_effect("tau_2")
    others = [delay_effect(one) for one in model.channels if not one.startswith("tau")]
    task: Any = SimpleNamespace(model=model, records=(Record(read, FS),))
    right: Any = None
    for known, held in (
        ({}, []),
        ({early: -5e-4}, [("tau_1", "tau_2"), ("tau_1",)]),
        ({early: -5e-4, late: 2e-3}, [("tau_1",)]),
        ({early: -5e-4, late: -5e-4}, [("tau_1", "tau_2")]),
        # only differences of times show: all other channels may be late in their place, alike
        (dict.fromkeys(others, 5.2e-4), [("tau_1", "tau_2")]),
        (dict.fromkeys(others, 1e-3), []),
        (dict.fromkeys(others[1:], 5e-4), []),
        (dict(zip(others, (5e-4, 5e-4, 5e-4, 1.5e-3), strict=True)), []),
    ):
        assert channels_set_right._held(Aligned(task, known, right, 0.0)) == held


def test_channels_are_set_right_where_no_point_comes_to_rest_on_the_way() -> None:
    model, read, _ = made()
    record = Record(read | {"tau_1": shift("tau_1", -1.0).whole(read["tau_1"])}, FS)
    task = prepared(model, [record], Auto(), Filters(cutoff_hz=60.0), CheckOptions())
    changed, right = channels_set_right.with_channels_set_right(task, lambda changed: None)
    assert right is not None
    assert right.late == (("tau_1", pytest.approx(1e-3, rel=0.02), pytest.approx(0.0, abs=1e-4)),)
    assert changed.records[0] is not record


def test_what_noise_moves_a_size_by_is_known() -> None:
    rng = np.random.default_rng(1)
    n, noise = 200_000, 0.5
    w = rng.standard_normal(n)
    effect = 2.0 * w + 0.3 * rng.standard_normal(n)
    read = w + noise * rng.standard_normal(n)
    y = w
    W = np.column_stack([read, effect])
    found = np.linalg.lstsq(W, y, rcond=None)[0]
    share = np.linalg.lstsq(read[:, None], effect, rcond=None)[0]
    left = effect - read * share[0]
    # noise n of the column adds n^T (0 - n x) to its product with Y - W x
    pull = np.array([-n * noise**2 * 1.0])
    assert pulled_size(share, pull, left) == pytest.approx(found[1] - 0.0, rel=0.02)


@pytest.mark.slow
def test_of_a_long_record_the_middle_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    model, read, truth = made()
    monkeypatch.setattr(channels_set_right, "ALIGNED_ON", 4000)
    estimate = estimated(model, read | {"tau_1": shift("tau_1", -1.0).whole(read["tau_1"])})
    (said,) = told(estimate)
    assert "tau_1 is late" in said
    assert np.max(np.abs(errors(estimate, truth))) < 4.0


def test_what_explains_the_rows_as_well_is_said_and_held() -> None:
    zero, late = (make("tau_1") for make in (lambda key: zero_effect(key, None, 1), delay_effect))
    instead = Instead(late, 1e-3, {"K_1": 3.0, "D_1": -4.0})
    right = SetRight(
        ("K_1", "D_1"), (zero,), (0.1,), np.zeros((2, 1)), np.zeros((1, 1)), others=((instead,),)
    )
    (said,) = right.advice
    assert "zero of its own (+0.1)" in said.what
    assert "or tau_1 is late by 1e+03 us: the intervals hold for either" in said.what
    fit: Any = SimpleNamespace(columns=("D_1", "K_1"))
    assert np.array_equal(right.drift(fit), [[16.0, -12.0], [-12.0, 9.0]])


@pytest.mark.parametrize("known", [(), ("tau_1",)])
def test_forces_that_are_taken_as_held_are_not_held_once_more(
    monkeypatch: pytest.MonkeyPatch, known: tuple[str, ...]
) -> None:
    """Late by half a sample is what a hold adds: held once more commands were late by a whole one."""
    model, read, _ = made()
    task = prepared(model, [Record(read, FS)], Auto(), Filters(cutoff_hz=60.0), CheckOptions())
    late, none = delay_effect("tau_1"), np.zeros((1, 1))
    right = SetRight(("K1",), (late,), (5e-4,), none, none)
    tried = []

    def rests(given: Any, *more: Any, held: bool = False) -> Aligned:
        tried.append(held)
        return Aligned(given, {late: 5e-4}, right, 0.0)

    monkeypatch.setattr(channels_set_right, "_come_to_rest", rests)
    monkeypatch.setattr(channels_set_right, "_with_zeros", lambda task, *more: (task, {}))
    channels_set_right.with_channels_set_right(task, lambda changed: None, known)
    assert (True in tried) == (not known)
