"""Gyros and accelerometers that are not mounted as the file says: turned, or one axis off scale."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic.channel_errors import (
    Turned,
    mountings,
    resolved,
    runs_away,
    set_right,
    tried_size,
)
from modelgen.runtime.iv.effect import TILT
from modelgen.runtime.records.record import Record
from tests.runtime.identification.elastic.test_channels_set_right import errors, estimated, told
from tests.runtime.identification.elastic.test_link_forces import model_of
from tests.symbolic.arms.elastic_arms import PLANAR, elastic, exact_record, readings, values_of, with_sensors
from tests.symbolic.arms.made_arms import serial

FS, ANGLE = 1000.0, 0.04
SENSORS = (
    {"key": "q_1", "measures": "position", "channels": ("q_1",)},
    {"key": "g_1", "measures": "gyro", "channels": ("g_1_x", "g_1_y", "g_1_z")},
    {"key": "g_2", "measures": "gyro", "channels": ("g_2_x", "g_2_y", "g_2_z")},
    {"key": "a_2", "measures": "accelerometer", "channels": ("a_2_x", "a_2_y", "a_2_z")},
    {"key": "a_3", "measures": "accelerometer", "channels": ("a_3_x", "a_3_y", "a_3_z")},
)
READ = ("q_1", "g_1_z", "g_2_x", "g_2_y", "g_2_z", "a_2_x", "a_2_y", "a_3_x", "a_3_y", "a_3_z")
MODEL: Any = SimpleNamespace(
    module=SimpleNamespace(SENSORS=SENSORS),
    channels=READ,
    parameters=("K_1", "R_a_3_x_x", "R_a_3_x_y"),
    actuators=(),
    derived={},
    loads=(),
)


def test_axes_that_are_read_may_be_turned_and_a_single_one_off_scale() -> None:
    """Nothing is looked for where the mounting is estimated with the parameters."""
    names = [one.name for one in mountings(MODEL)]
    assert names == [
        "gain of g_1_z",
        "turn of g_2_x to g_2_y",
        "turn of g_2_x to g_2_z",
        "turn of g_2_y to g_2_z",
        "turn of a_2_x to a_2_y",
    ]


def test_a_turned_sensor_is_set_right() -> None:
    turn = next(one for one in mountings(MODEL) if one.name == "turn of a_2_x to a_2_y")
    rng = np.random.default_rng(1)
    x, y, z = rng.standard_normal((3, 50))
    read = {
        "a_2_x": np.cos(ANGLE) * x - np.sin(ANGLE) * y,
        "a_2_y": np.cos(ANGLE) * y + np.sin(ANGLE) * x,
        "a_2_z": z,
    }
    found = set_right(MODEL, Record(read, FS, "turned"), 0, {turn: ANGLE}).signals
    for key, wanted in (("a_2_x", x), ("a_2_y", y), ("a_2_z", z)):
        np.testing.assert_allclose(found[key], wanted, atol=1e-12)


def test_an_axis_off_scale_is_set_right() -> None:
    gain = next(mountings(MODEL))
    record = Record({"g_1_z": np.array([1.1, -2.2])}, FS, "off scale")
    np.testing.assert_allclose(set_right(MODEL, record, 0, {gain: 0.1}).signals["g_1_z"], [1.0, -2.0])


@pytest.mark.parametrize("name", ["gain of g_1_z", "turn of g_2_x to g_2_y"])
def test_mountings_are_off_by_what_mistakes_make(name: str) -> None:
    effect = next(one for one in mountings(MODEL) if one.name == name)
    record = Record(dict.fromkeys(READ, np.zeros(8)), FS, "rest")
    assert isinstance(effect, Turned) == (effect.kind == TILT)
    assert resolved(effect, ANGLE, [record])
    assert not resolved(effect, 1e-6, [record])
    assert runs_away(effect, 0.3, [record])
    assert not runs_away(effect, ANGLE, [record])
    assert 0.0 < tried_size(effect, record) < 1e-2 * ANGLE


@pytest.mark.slow
def test_a_gyro_that_is_tilted_is_named_and_set_right() -> None:
    """By 2 degrees: what it reads of an axis alone is 0.06 % less, and a stiffness was 11 deviations off."""
    motors, gyros = ([(one, *read) for one in "12"] for read in (("motor", "position"), ("link", "gyro")))
    spec = with_sensors(elastic(serial(PLANAR, drive=True)), *motors, *gyros)
    model, values = model_of(spec), values_of(spec, np.random.default_rng(3))
    motion, forces = exact_record(
        spec, values, np.arange(0.0, 8.0, 1.0 / FS), np.random.default_rng(3), tempo=2.0
    )
    rates = np.cumsum([motion["1", 1], motion["2", 1]], axis=0)
    signals = readings(spec, motion, forces, "s")
    signals |= {f"link_gyro_{joint}_z": rate for joint, rate in zip("12", rates, strict=True)}
    rng, sizes = np.random.default_rng(4), {"motor": 5e-6, "link": 1e-3, "tau": 0.002}
    read = {
        key: signals[key] + sizes[key.split("_")[0]] * rng.standard_normal(len(signals[key]))
        for key in model.channels
    }
    truth = model.base_from_physical({name: values[name] for name in model.parameters})
    by_name = dict(zip(model.base_parameters, truth.tolist(), strict=True))
    for share in (1.0, np.cos(np.radians(2.0))):
        found = estimated(model, read | {"link_gyro_2_z": share * read["link_gyro_2_z"]})
        named = any("the gain of link_gyro_2_z is off (-0.06" in said for said in told(found))
        assert named == (share < 1.0)
        assert not [said for said in told(found) if "gain" in said and not named]
        assert np.max(np.abs(errors(found, by_name))) < 4.0
