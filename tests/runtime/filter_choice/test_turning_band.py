from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.turning_band import direction_cutoff, turning_band_hz, turns_late
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from tests.runtime.made_arm_records import catalogued, model_of

FS = 1000.0


@pytest.mark.parametrize("derivative", [0, 1])
def test_noise_in_the_band_changes_the_speed_by_a_tenth_of_turning(derivative: int) -> None:
    size, turning = 1e-3, 20.0
    band_hz = turning_band_hz(turning, 2.0 * size**2 / FS, derivative, FS)
    noise = size * np.random.default_rng(0).standard_normal(200_000)
    speed = noise if derivative == 0 else np.gradient(noise, 1.0 / FS)
    rms = float(np.std(zero_phase(speed, 8, band_hz, FS)))
    assert 2.0 * np.pi * band_hz * rms == pytest.approx(0.1 * turning, rel=0.1)


def test_quiet_sensors_are_read_to_a_share_of_the_sampling_frequency() -> None:
    assert turning_band_hz(1.0, 0.0, 1, FS) == 0.4 * FS
    assert turning_band_hz(0.0, 1.0, 1, FS) == 0.0


def swinging(model: Model, noise: float, bend: float = 0.4, seed: int = 1, n: int = 10000) -> Record:
    """Return a swing whose speed slows down the more steeply the more friction bends it where it reverses."""
    t, rng = np.arange(n) / FS, np.random.default_rng(seed)
    speed = 9.0 * (np.cos(9.0 * t) + bend * np.abs(np.cos(9.0 * t)) * np.sin(9.0 * t))
    swing = np.cumsum(speed) / FS
    return Record({key: swing + noise * rng.standard_normal(n) for key in model.channels}, FS)


def test_joints_turn_as_fast_as_their_encoders_tell() -> None:
    arm, chain = model_of(catalogued("two_link")), model_from_module(emps_rigid_qm)
    quiet, loud = (direction_cutoff(arm, [swinging(arm, noise)], 10.0, 2.0) for noise in (1e-5, 1e-3))
    assert 10.0 < loud < quiet < 0.4 * FS
    assert direction_cutoff(arm, [swinging(arm, 1e-5), swinging(arm, 1e-3)], 10.0, 2.0) == loud
    assert direction_cutoff(arm, [swinging(arm, 1.0)], 10.0, 2.0) == 10.0
    assert direction_cutoff(chain, [swinging(chain, 1e-5)], 10.0, 2.0) == 2.0


def test_speeds_that_springs_give_turn_behind_the_cut_off_of_the_rows() -> None:
    spec = catalogued("elastic_two_link")
    motors, links = spec.sensor_sets["encoders"][:2], spec.sensor_sets["encoders"][2:]
    spec = replace(spec, sensor_sets={"motors": motors, "mixed": (motors[0], *links)})
    found = {}
    for name in spec.sensor_sets:
        model = model_of(spec, sensor_set=name)
        found[name] = direction_cutoff(model, [swinging(model, 1e-5)], 10.0, 2.0)
    assert found["mixed"] == 10.0 < found["motors"]


@pytest.mark.parametrize("seed", range(4))
def test_where_nothing_bends_a_motion_noise_needs_no_wide_band(seed: int) -> None:
    """Noise turns friction at wrong samples: a band is as wide as the bends of the motion ask for."""
    arm = model_of(catalogued("two_link"))
    smooth, bent = (swinging(arm, 1e-5, bend, seed) for bend in (0.0, 0.4))
    wide = direction_cutoff(arm, [bent], 10.0, 2.0)
    assert wide > 50.0
    assert 10.0 <= direction_cutoff(arm, [smooth], 10.0, 2.0) < 20.0
    # one joint in one record that turns late behind a lower band decides
    assert direction_cutoff(arm, [smooth, bent], 10.0, 2.0) >= 0.5 * wide
    # a few reversals say nothing
    assert direction_cutoff(arm, [swinging(arm, 1e-5, 0.0, seed, 2500)], 10.0, 2.0) > 50.0


def test_reversals_that_a_low_pass_swallows_are_late() -> None:
    t = np.arange(20000) / FS
    wide = np.sin(9.0 * t) + 0.5 * np.sin(100.0 * t)
    narrow = np.sin(9.0 * t)
    assert turns_late([narrow], [wide], 50.0) and not turns_late([wide], [wide], 50.0)
