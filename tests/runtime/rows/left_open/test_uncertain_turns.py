"""Directions that given speeds do not tell are left open: nothing follows from one that is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from benchmarks.elastic_motion import elastic_motion, record_along
from modelgen import CheckOptions, Filters, identify
from modelgen.cli.arms.simulate_arm import mounted
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.deflected_rows import held_positions
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.planning.arms.predicted_sets import USUAL_NOISE
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.left_open.open_forces import pulses_of
from modelgen.runtime.rows.left_open.uncertain_turns import leaves_turns_open, without_uncertain_turns
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.arms.arm_plant import arm_plant
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, fourier_reference
from modelgen.runtime.simulation.arms.mounted_sensors import sensor_channels
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path
from tests.runtime.planning.arms.test_fast_excitation import arm
from tests.symbolic.arms.elastic_arms import with_sensors
from tests.symbolic.arms.test_elastic_rows import both

FS, CUTOFF_HZ, HIGHEST_HZ, DAMPED = 1000.0, 21.5, 6.0, 0.98
QUIET = dict.fromkeys(USUAL_NOISE, 0.0)
ARM = load_arm(catalog_path("elastic_two_link"))


@lru_cache(maxsize=1)
def models() -> tuple[Model, Model]:
    """Return the models of encoders on links, and on both sides of the springs."""
    found = []
    for sensors in (both("link"), (*both(), *both("link"))):
        ((name, text),) = arm_files(with_sensors(ARM, *sensors), "s").items()
        found.append(model_from_text(text, name))
    return found[0], found[1]


def periodic(noise: bool = False) -> Record:
    """Return a record whose motors reverse at the same places between samples period after period."""
    return along(0, noise)


def periodic_on_both() -> Record:
    """Return the same with encoders on motors as well."""
    return along(1, False)


@lru_cache(maxsize=4)
def along(of: int, noise: bool) -> Record:
    t, rng = np.arange(0.0, 6.0, 1.0 / FS), np.random.default_rng(3)
    links = {}
    for joint in ARM.moving:
        parts = [(0.5 / k, 2.0 * np.pi * HIGHEST_HZ * k / 5.0) for k in range(1, 6)]
        links[joint.name] = sum(size * np.sin(w * t + rng.uniform(0.0, 6.0)) for size, w in parts)
    moved = elastic_motion(models()[1], ARM.parameter_sets["nominal"], links, FS)
    return record_along(models()[of], moved, noise=None if noise else QUIET)


@pytest.mark.slow
def test_reversals_that_a_low_pass_moves_over_a_sample_move_no_parameter() -> None:
    model, values = models()[0], ARM.parameter_sets["nominal"]
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    found = identify(model, periodic(), "wls", Filters(cutoff_hz=CUTOFF_HZ), CheckOptions(tests=False)).params
    # springs and inertias of joint 1 were 0.1 to 0.2 % off
    for name in ("Izz_1_R", "Ia_1", "K_1", "D_1", "Izz_2", "Ia_2", "K_2", "D_2"):
        assert found[name] == pytest.approx(exact[name], rel=1e-4), name


def near_the_truth(sampled: bool = True) -> Model:
    """Return the model about a point whose dampers are off by as much as noise leaves them."""
    model, values = models()[0], ARM.parameter_sets["nominal"]
    assert isinstance(model.kernel, DeflectedKernel)
    point = model.base_from_physical({**values, "D_1": DAMPED * values["D_1"]})
    return replace(model, kernel=model.kernel.at(point, sampled))


def opened(record: Record) -> tuple[list[RowBlock], list[RowBlock]]:
    """Return the blocks with all directions as they are, and with uncertain ones left open."""
    model = near_the_truth()
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    rows = observe(model, [record], choice)
    return list(rows.blocks), list(without_uncertain_turns(rows, model, [record], choice, 0).blocks)


def test_what_the_force_does_where_a_direction_is_uncertain_is_in_no_row() -> None:
    record = periodic(noise=True)
    before, after = opened(record)
    assert any(np.any(one.Y != other.Y) for one, other in zip(before, after, strict=True))
    for one, other in zip(before, after, strict=True):
        gone = one.Y - other.Y
        assert one.count == other.count
        # parts along pulses are taken, whole or, of small sums of them, a share; and these are few
        assert 0.0 <= gone @ other.Y < 2e-3 * float(one.Y @ one.Y)
        assert np.any(gone) == (other.opened > 0) and other.opened < 0.3 * one.count


def test_a_wrong_direction_there_changes_nothing() -> None:
    truth = models()[0].base_from_physical(ARM.parameter_sets["nominal"])
    before, after = ([float(np.std(one.residual(truth))) for one in blocks] for blocks in opened(periodic()))
    # without noise rows leave what the wrong directions of joint 1 make of its friction
    assert before[0] > 30.0 * after[0] and before[0] > 30.0 * before[1]


def test_rows_about_no_estimate_stay_as_they_are() -> None:
    model, record = near_the_truth(sampled=False), periodic()
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    rows = observe(model, [record], choice)
    assert not leaves_turns_open(model)
    assert without_uncertain_turns(rows, model, [record], choice, 0) is rows


def test_a_row_leaves_open_what_moves_the_links_that_it_holds() -> None:
    gyros = [(joint, "link", "gyro") for joint in ("1", "2")]
    ((name, text),) = arm_files(with_sensors(ARM, *both(), *gyros), "s").items()
    model = model_from_text(text, name)
    assert isinstance(model.kernel, DeflectedKernel)
    held = {row.name: len(held_positions(model.kernel, place)) for place, row in enumerate(model.rows)}
    felt = {name: count for name, count in held.items() if name.startswith("link_gyro")}
    assert {count for name, count in felt.items() if "_1" in name} == {1}
    assert {count for name, count in felt.items() if "_2" in name} == {2}


@dataclass(frozen=True)
class SlowMotion:
    """A model, the base parameters that moved, and what motors did and sensors read at 1 kHz."""

    model: Model
    exact: dict[str, float]
    motor_speeds: np.ndarray
    read: dict[str, np.ndarray]


def slow_motion(
    sensors: Sequence[tuple[str, str, str]],
    friction: Mapping[str, float],
    limits: JointLimits,
    seed: int = 1,
) -> SlowMotion:
    """Simulate 10 s with so many times the friction; where no limit says so, as far as the joints go."""
    full, given, joints = arm()
    spec = with_sensors(ARM, *sensors)
    ((name, text),) = arm_files(spec, "s").items()
    model = model_from_text(text, name)
    values = {**given, **{name: times * given[name] for name, times in friction.items()}}
    reached = {one.name: replace(limits, position=limits.position or one.position) for one in joints}
    moved = simulate_arm(full, values, fourier_reference(full, 10.0, 1000.0, reached, seed=seed))
    true = sensor_channels(arm_plant(full, full.base_from_physical(values)), mounted(spec, "s"), moved.motion)
    every = {**true, **{name: moved.true[name] for name in ("tau_1", "tau_2")}}
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    read = {key: np.asarray(every[key]) for key in model.channels}
    return SlowMotion(model, exact, np.asarray(moved.motion.v)[2:], read)


STUCK_ON_BOTH = (
    (("K_1", "K_2", "mx_1_R", "mx_2"), 5e-5),
    (("Fs_1", "Fs_2", "Ia_1", "Ia_2"), 1e-3),
    (("Fv_1", "Fv_2"), 4e-3),
)
STUCK_WITH_TORQUES = ((("Fs_1", "Fs_2"), 5e-4), (("Ia_1", "Ia_2"), 1e-3), (("Fv_1", "Fv_2"), 2e-3))
STUCK_ALONE = (
    (("Fs_1", "Fs_2"), 5e-4),
    (("mx_1_R", "mx_2"), 1e-4),
    (("Fv_1", "Fv_2"), 1e-3),
    (("K_1", "K_2"), 0.05),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("others", "limits"),
    [
        # springs were up to 0.13 % off, rotors 0.9 and 6.4 %, Fs_2 1.4 %, Fv_2 7.7 %
        (both("link"), STUCK_ON_BOTH),
        # where torques place links: rotors were 0.7 and 6.8 % off, Fs_2 1.1 %, Fv_2 5.9 %
        ((("1", "between", "torque"), ("2", "between", "torque")), STUCK_WITH_TORQUES),
        # where friction moves links: Fs_1 was 0.3 % off, Fv_2 4.9 %, K_1 14 %, K_2 four times too large
        ((), STUCK_ALONE),
    ],
    ids=["link encoders", "joint torques", "motors alone"],
)
def test_motors_that_stick_for_some_samples_move_no_parameter(
    others: Sequence[tuple[str, str, str]], limits: Sequence[tuple[tuple[str, ...], float]]
) -> None:
    friction = dict.fromkeys(("Fs_1", "Fs_2"), 4.0)
    moved = slow_motion((*both(), *others), friction, JointLimits(None, 1.0, 100.0))
    assert 0.01 < np.mean(np.abs(moved.motor_speeds) < 1e-12) < 0.1
    record = Record({key: one[::4] for key, one in moved.read.items()}, 250.0, "slow")
    found = identify(moved.model, record, "wls", Filters(cutoff_hz=10.0), CheckOptions(tests=False)).params
    for names, most in limits:
        for name in names:
            assert found[name] == pytest.approx(moved.exact[name], rel=most), name


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "rotor"), [(1, 0.25), (2, 0.01), (3, 0.01)])
def test_motors_that_no_sensor_sees_may_rest_for_long(seed: int, rotor: float) -> None:
    """Torques place them. Of seed 1 the rotor was 12 times as large, friction 42 % off; 6 and 7 % rotors."""
    sensors = (*both("link"), ("1", "between", "torque"), ("2", "between", "torque"))
    moved = slow_motion(sensors, {"Fs_2": 40.0}, JointLimits(None, 3.0, 200.0), seed)
    assert np.mean(np.abs(moved.motor_speeds[1]) < 1e-12) > 0.05
    rng, read = np.random.default_rng(seed), {}
    for key, one in moved.read.items():
        noise = 5e-6 if key.startswith("q") else 2e-3 * float(np.std(one))
        read[key] = (one + noise * rng.standard_normal(len(one)))[::2]
    found = identify(moved.model, Record(read, 500.0, "slow"), checks=CheckOptions(tests=False)).params
    for name, most in (("Ia_2", rotor), ("Fv_2", 0.06), ("Fs_2", 3e-3)):
        assert found[name] == pytest.approx(moved.exact[name], rel=most), name


@pytest.mark.slow
def test_slow_motion_turns_too_often_for_a_few_open_samples() -> None:
    """A quarter of the intervals turn. Of 0.25 left open K_1 was 18 % off, Ia_1 43, Izz_1_R 11."""
    friction = dict.fromkeys(("Fs_1", "Fs_2"), 10.0)
    moved = slow_motion(both(), friction, JointLimits((-0.78, 0.78), 1.0, 100.0))
    record = Record({key: one[::2] for key, one in moved.read.items()}, 500.0, "slow")
    found = identify(moved.model, record, checks=CheckOptions(tests=False)).params
    for name, most in (("K_1", 0.06), ("Ia_1", 0.12), ("Izz_1_R", 0.03)):
        assert found[name] == pytest.approx(moved.exact[name], rel=most), name


def test_a_force_is_left_open_as_links_lag_behind_it() -> None:
    """Springs with eight times the damping: taken to move links at once, it left seven times as much."""
    sensors = (*both(), ("1", "link", "velocity"), ("2", "link", "velocity"))
    damped = {"Fs_1": 4.0, "Fs_2": 4.0, "D_1": 8.0, "D_2": 8.0}
    moved = slow_motion(sensors, damped, JointLimits(None, 3.0, 100.0))
    record = Record({key: one[:4000] for key, one in moved.read.items()}, 1000.0, "slow")
    truth = np.array([moved.exact[name] for name in moved.model.base_parameters])
    assert isinstance(moved.model.kernel, DeflectedKernel)
    model = replace(moved.model, kernel=moved.model.kernel.at(truth, sampled=True))
    choice = choose_filter(model, [record], cutoff_hz=20.0)
    rows = observe(model, [record], choice)
    opened = without_uncertain_turns(rows, model, [record], choice, 0)
    for before, after in zip(rows.blocks, opened.blocks, strict=True):
        assert np.std(before.residual(truth)) > 50.0 * np.std(after.residual(truth)), before.row_name


def test_a_lag_beyond_all_records_takes_no_memory() -> None:
    """A record without motion had led to a spring of nearly nothing, and to pulses of 131 PiB."""
    model, record = models()[1], periodic_on_both()
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    rows = unmasked_rows(model, record, choice, choice.decimation[0], 0)
    assert pulses_of(rows, choice, lags=(1e12,)).shape[1] < 5000


def test_rows_without_samples_that_feel_reversals_stay_as_they_are() -> None:
    model, record = models()[1], periodic_on_both()
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    rows = observe(model, [record], choice)
    for turns in (True, False):
        blocks = without_uncertain_turns(rows, model, [record], choice, 0, turns).blocks
        assert any(block.opened for block in blocks) is turns
