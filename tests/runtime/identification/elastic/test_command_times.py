"""Commands that drives hold, told by the times of forces alone before anything else is looked for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from modelgen.runtime.identification.elastic.channel_errors import SetRight
from modelgen.runtime.identification.elastic.command_times import CommandTimes, times_of_commands
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from tests.runtime.identification.elastic.test_channels_set_right import (
    FS,
    errors,
    estimated,
    exact_channels,
    made,
    told,
)
from tests.symbolic.arms.elastic_arms import two_link, with_sensors

DRIVES = ("tau_1", "tau_2")


@lru_cache(maxsize=1)
def tachometers() -> tuple[Model, dict[str, np.ndarray], dict[str, float]]:
    """Return a model with tachometers on both sides of both joints, noisy channels, and true parameters."""
    sides = (("motor", "velocity"), ("link", "velocity"))
    spec = with_sensors(two_link(), *((joint, *side) for joint in ("1", "2") for side in sides))
    rng = np.random.default_rng(3)
    model, signals, truth = exact_channels(spec, rng)
    noise = {"rad/s": 1e-3, "N m": 0.05}
    read = {
        key: signals[key] + noise[model.channel_units[key]] * rng.standard_normal(len(signals[key]))
        for key in model.channels
    }
    return model, read, truth


def told_of(model: Model, read: dict[str, np.ndarray], samples: float) -> CommandTimes | None:
    """Return what rows say where the drives' forces are recorded so many samples early."""
    moved = {key: shift(key, samples).whole(read[key]) for key in DRIVES}
    task = prepared(model, [Record(read | moved, FS)], Auto(), Filters(cutoff_hz=40.0), CheckOptions())
    return times_of_commands(task)


@pytest.mark.parametrize("kind", ["encoders", "tachometers"])
def test_half_a_sample_of_all_drives_is_seen_though_dampers_take_most_of_it(kind: str) -> None:
    model, read, _ = made() if kind == "encoders" else tachometers()
    early, right = told_of(model, read, 0.5), told_of(model, read, 0.0)
    assert early is not None
    assert early.holds
    assert not early.alike
    assert early.drives == DRIVES
    assert right is not None
    assert not right.holds


def test_where_springs_give_positions_that_has_been_looked_at() -> None:
    model, read, _ = made(("motor",))
    assert told_of(model, read, 0.0) is None


def test_what_rows_do_not_tell_is_in_the_intervals() -> None:
    times = CommandTimes(DRIVES, -100.0, -101.0, {"K": 0.0, "D": 2.0})
    assert times.alike
    assert not times.holds
    (beyond,) = (SetRight.only((times.move,)),)
    assert not beyond.effects
    assert beyond.advice == ()
    fit = Fit.__new__(Fit)
    object.__setattr__(fit, "columns", ("D", "K", "J"))
    np.testing.assert_array_equal(beyond.drift(fit), np.diag([4.0, 0.0, 0.0]))


@pytest.mark.slow
def test_tachometers_of_both_sides_tell_that_commands_are_held() -> None:
    """Dampers had been up to 19 deviations off, beside a tachometer that was said to be late."""
    model, read, truth = tachometers()
    held = {}
    for joint, key in enumerate(DRIVES, 1):
        force, speed = read[key], f"motor_velocity_{joint}"
        # the mean of a command over a sample is the force, and the speed is read where that changes
        before = force - np.gradient(np.gradient(force)) / 24.0
        held[key] = shift(key, 0.5).whole(before)
        held[speed] = read[speed] - np.gradient(force) / (12.0 * FS * truth[f"Ia{joint}"])
    found = estimated(model, read | held)
    assert any("tau_1, tau_2 are commands which the drive holds" in said for said in told(found))
    assert np.max(np.abs(errors(found, truth))) < 4.0
    assert not any("late" in said for said in told(found))
