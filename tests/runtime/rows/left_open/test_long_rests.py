"""Motors that rest between moves: rows use all but the rest, and not what holds the motor there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import pytest

from modelgen import JointController, Record, identify, simulate_arm
from modelgen.array_types import FloatArray
from modelgen.cli.arms.simulate_arm import mounted
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.rows.left_open.uncertain_turns import without_uncertain_turns
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.arms.arm_plant import arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.mounted_sensors import sensor_channels
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path
from tests.symbolic.arms.elastic_arms import with_sensors

FS, CUTOFF_HZ, LONGEST_REST_S = 1000.0, 15.0, 0.35
ARM = load_arm(catalog_path("elastic_two_link"))
# as much friction as makes motors stick where they stand
STICKING = {**ARM.parameter_sets["nominal"], "Fs_1": 12.0, "Fs_2": 4.0}
MOTOR, TORQUE, LINK = ("motor", "position"), ("link", "torque"), ("link", "position")


def sensed(*kinds: tuple[str, str]) -> ArmSpec:
    """Return the arm with these sensors at both joints."""
    return with_sensors(ARM, *((joint, *kind) for joint in ("1", "2") for kind in kinds))


@lru_cache(maxsize=4)
def model_of(*kinds: tuple[str, str]) -> Model:
    """Return the model of these sensors at both joints."""
    ((name, text),) = arm_files(sensed(*kinds), "s").items()
    return model_from_text(text, name)


def moves(duration_s: float) -> FloatArray:
    """Return both joints' position and its derivatives, from point to point with rests, shape (3, 2, N)."""
    rng, count = np.random.default_rng(5), round(duration_s * FS)
    t, motion = np.arange(count) / FS, np.zeros((3, 2, count))
    for joint in range(2):
        begins, at = 0.3, 0.0
        while begins < duration_s - 1.0:
            takes, to = rng.uniform(0.3, 0.6), rng.uniform(-1.0, 1.0)
            s = np.clip((t - begins) / takes, 0.0, 1.0)
            motion[0, joint] += (to - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            motion[1, joint] += (to - at) * 30.0 * (s * (1.0 - s)) ** 2 / takes
            motion[2, joint] += (to - at) * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / takes**2
            begins, at = begins + takes + rng.uniform(0.15, LONGEST_REST_S), to
    return motion


def motor_row(turns: bool, holding: float = 0.0) -> RowBlock:
    """Return the row of the first motor that moves so, held in its rests by a force of that size in N m."""
    position, speed, acceleration = moves(16.0)
    model, rng = model_of(MOTOR, LINK), np.random.default_rng(6)
    signals = dict(zip(model.channels, np.zeros((len(model.channels), position.shape[1])), strict=True))
    for joint in range(2):
        force = 2.0 * acceleration[joint] + 3.0 * np.sign(speed[joint])
        read = position[joint] + 1e-6 * rng.standard_normal(position.shape[1])
        still = np.abs(speed[joint]) == 0.0
        slow = np.sin(0.01 * np.arange(position.shape[1]))
        signals |= {
            f"motor_position_{joint + 1}": read,
            f"link_position_{joint + 1}": position[joint],
            f"tau_{joint + 1}": force + np.where(still, holding * slow, 0.0),
        }
    record = Record(signals, FS, "moves")
    choice = choose_filter(model, [record], cutoff_hz=CUTOFF_HZ)
    if turns:
        return observe(model, [record], choice).blocks[0]
    rows = observe(model, [record], choice, turns="open")
    return without_uncertain_turns(rows, model, [record], choice, 0).blocks[0]


def test_rests_are_left_open_in_place_of_all_that_feels_them() -> None:
    """A mask as wide as the low-pass reaches leaves little of a motor that moves half of the time."""
    masked, opened = motor_row(turns=True), motor_row(turns=False)
    # what open forces take counts too
    assert opened.count - opened.opened > 2.0 * masked.count
    assert opened.count > 0.4 * opened.grid


def test_what_holds_a_motor_in_a_rest_is_in_no_row() -> None:
    plain, held = motor_row(turns=False), motor_row(turns=False, holding=5.0)
    np.testing.assert_array_equal(plain.place, held.place)
    assert float(np.std(held.Y - plain.Y)) < 0.01 * float(np.std(plain.Y))


def read_by(
    kinds: Sequence[tuple[str, str]], motion: FloatArray, noise: Mapping[str, float]
) -> tuple[Model, Record]:
    """Return a model and what its sensors read, of noise by unit, where controllers follow a motion.

    That is position, speed and acceleration of both motors, shape (3, 2, N), in SI.
    """
    full, model = model_of(MOTOR, LINK), model_of(*kinds)
    reference = JointReference(JointMotion(*motion, FS))
    moved = simulate_arm(full, STICKING, reference, fs=FS, controller=JointController(bandwidth_hz=6.0))
    plant = arm_plant(full, checked_base(full, STICKING))
    signals = sensor_channels(plant, mounted(sensed(*kinds), "s"), moved.motion)
    signals |= {key: moved.true[key] for key in plant.forces}
    rng = np.random.default_rng(6)
    read = {
        key: signals[key] + noise[model.channel_units[key]] * rng.standard_normal(len(signals[key]))
        for key in model.channels
    }
    return model, Record(read, FS, "moves")


@pytest.mark.slow
def test_moves_with_rests_tell_all_that_sensors_see() -> None:
    """Motors and torques of joints: not every number had been found."""
    model, record = read_by((MOTOR, TORQUE), moves(8.0), {"rad": 5e-6, "N m": 0.05})
    found, names = identify(model, record), model.base_parameters
    truth = model.base_from_physical({name: STICKING[name] for name in model.parameters})
    assert set(found.params) == set(names)
    off = {n: (found.params[n] - x) / found.bse[n] for n, x in zip(names, truth, strict=True)}
    assert max(abs(one) for one in off.values()) < 4.0, off
