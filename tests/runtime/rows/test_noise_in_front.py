"""Noise in front of lines that hold positions which springs give, late where these are damped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.given_directions import Succession
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.noise_in_front import beyond_series
from tests.runtime.made_arm_records import catalogued, model_of
from tests.runtime.mirrored_noise import lifted_and_expected
from tests.symbolic.arms.elastic_arms import with_sensors
from tests.symbolic.arms.test_elastic_rows import both

FS = 1000.0
# A damper over its spring in s: beyond 1 / (2 pi LAG) = 64 Hz no series holds.
LAG = 2.5e-3
NOISE = {"rad": 5e-6, "N m": 0.1}


def damped() -> tuple[Model, DeflectedKernel, np.ndarray]:
    """Return two joints of which only the motors are seen, about a point whose springs lag by LAG."""
    arm = catalogued("elastic_two_link")
    values = dict(arm.parameter_sets["nominal"])
    values |= {"Fs_1": 0.0, "Fs_2": 0.0, "D_1": LAG * values["K_1"], "D_2": LAG * values["K_2"]}
    model = model_of(with_sensors(arm, *both()), sensor_set="s")
    point = model.base_from_physical({name: values[name] for name in model.parameters})
    assert isinstance(model.kernel, DeflectedKernel)
    kernel = model.kernel.at(point, sampled=True)
    return replace(model, kernel=kernel), kernel, point


def moved(model: Model) -> Record:
    """Return tones to 6 Hz in every channel."""
    t, rng = np.arange(0.0, 8.0, 1.0 / FS), np.random.default_rng(3)
    tones = {
        key: sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) / f for f in (1.0, 2.5, 6.0))
        for key in model.channels
    }
    return Record({key: (60.0 if key[0] == "t" else 0.5) * one for key, one in tones.items()}, FS, "tones")


def test_a_given_position_sees_what_its_series_lacks_of_a_tone() -> None:
    _, kernel, _ = damped()
    t, f_hz = np.arange(0.0, 2.0, 1.0 / FS), 90.0
    s = np.array([2j * np.pi * f_hz])
    source = next(channel for channel, _ in kernel.reads if not channel.startswith("tau"))
    tone = {
        (key, order): np.real(s**order * np.exp(s * t)) if key == source else np.zeros(len(t))
        for key, order in kernel.reads
    }
    late = {read: np.real(one * np.exp(s * t)) for read, one in beyond_series(kernel, source, s).items()}
    assert late
    inside, followed = slice(200, -200), kernel.lines(tone, Succession(FS, None))
    held = [kernel.lines({**tone, **more}) for more in ({}, late)]
    entries = [key for key in kernel.kernel.keys if followed[key].any()]
    assert entries
    for key in entries:
        size = float(np.std(followed[key][inside]))
        without, with_late = (float(np.std((one[key] - followed[key])[inside])) for one in held)
        assert without > 0.5 * size
        assert with_late < 1e-4 * size


def test_noise_lifts_what_a_row_of_late_positions_leaves_as_predicted() -> None:
    """The wide low-pass ends at three times the frequency of the lag: a series makes many times as much."""
    model, _, point = damped()
    clean = moved(model)
    choice = choose_filter(model, [clean], cutoff_hz=15.0, signal_cutoff_hz=270.0)

    def read(level: float, seed: int) -> Record:
        rng = np.random.default_rng(seed)
        units = {one.key: one.unit for one in (*model.sensors, *model.actuators)}
        noise = {key: NOISE[units[key]] * rng.standard_normal(clean.n) for key in clean.keys}
        return clean.edited({key: clean.signals[key] + level * one for key, one in noise.items()})

    lifted, expected = lifted_and_expected(model, choice, read, 1.0, point)
    assert len(lifted) > 200
    assert float(lifted @ expected) / float(expected @ expected) == pytest.approx(1.0, abs=0.15)


def test_ways_of_noise_into_rows_about_one_point_are_looked_for_once() -> None:
    model, kernel, point = damped()
    record = moved(model)
    choice = choose_filter(model, [record], cutoff_hz=15.0, signal_cutoff_hz=270.0)
    ways = noise_ways(model, record, choice, 10)
    again = replace(model, kernel=kernel.at(point.copy()))
    assert noise_ways(again, record, choice, 10) is ways
    other = replace(model, kernel=kernel.at(1.1 * point, sampled=True))
    assert noise_ways(other, record, choice, 10) is not ways
    # directions are those of samples, whatever rows are made with
    fresh = noise_ways(again, moved(model), choice, 10)
    for one, same in zip(ways, fresh, strict=True):
        np.testing.assert_array_equal(one.means, same.means)
        np.testing.assert_array_equal(one.spread, same.spread)
