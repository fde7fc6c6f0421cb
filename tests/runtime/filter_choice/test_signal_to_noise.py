from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filter_choice.signal_to_noise import signal_to_noise
from modelgen.runtime.filters.noise_spectrum import reading_spectrum
from tests.runtime.rigid_motion import FS, RIGID, rigid_record


def test_the_density_of_white_noise_is_found_under_a_motion() -> None:
    t = np.arange(20000) / FS
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    for motion in (0.0 * t, 5.0 * t, np.sin(2.0 * t) + 0.1 * np.sin(60.0 * t)):
        # variance over half the sampling frequency
        assert reading_spectrum(motion + noise, FS).noise == pytest.approx(2e-6 / FS, rel=0.06)


def test_only_what_exceeds_its_noise_moves() -> None:
    t = np.arange(20000) / FS
    noise = np.random.default_rng(1).standard_normal(len(t))
    assert not reading_spectrum(noise, FS).moves
    assert not reading_spectrum(np.ones(len(t)), FS).moves
    assert reading_spectrum(noise + 2.0 * np.sin(7.0 * t), FS).moves
    assert reading_spectrum(0.01 * noise + 5.0 * t, FS).moves


def test_every_derivative_is_set_against_its_own_noise() -> None:
    noise = 1e-6
    record = rigid_record(noise=noise, force_noise=0.0)
    choice = choose_filter(RIGID, [record])
    found = {(entry.channel, entry.derivative): entry for entry in signal_to_noise(RIGID, [record], choice)}
    acceleration = found["q_m", 2]
    # white noise behind filter and two differentiations, integrated over the band
    f = np.arange(0.0, 500.0, 0.01)
    low_pass = 1.0 / (1.0 + (f / choice.cutoff_hz) ** (2 * choice.filter_order))
    density = 2.0 * noise**2 / FS * (low_pass * (2.0 * np.pi * f) ** 2) ** 2
    assert acceleration.noise_rms == pytest.approx(float(np.sqrt(density.sum() * 0.01)), rel=0.05)
    assert acceleration.snr_db == pytest.approx(
        20.0 * np.log10(acceleration.rms / acceleration.noise_rms), abs=0.1
    )
    assert acceleration.snr_db > 40.0
    # the fastest term of the motion, 3.1 Hz, is the last that stands out
    assert acceleration.visible_to_hz == pytest.approx(3.1, abs=0.2)


def test_a_louder_sensor_leaves_less_signal() -> None:
    records = [rigid_record(noise=noise) for noise in (1e-6, 1e-5)]
    choice = choose_filter(RIGID, records[:1])
    quiet, loud = (signal_to_noise(RIGID, [record], choice) for record in records)
    for one, other in zip(quiet, loud, strict=True):
        if one.channel == "q_m":
            assert one.snr_db is not None
            assert other.snr_db == pytest.approx(one.snr_db - 20.0, abs=1.0)
