"""What is folded into a force that bends: as large as theory says, and nothing where it does not bend."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.explanation.folded_forces import folded_forces, forces_bend
from modelgen.runtime.iv.companion_simulation import simulated_beside
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import FS, SMALL, TRUTH

N, FINE = 2000, 16
CORNERS = (300, 320, 900, 920, 1500, 1520)


def bent(noise: float) -> tuple[FloatArray, FloatArray]:
    """Return a force with corners at samples, and what of it is folded, shape (N,) each."""
    t = np.arange(N * FINE) / FINE
    # begins and ends at zero
    force = np.interp(t, (0, *CORNERS, N), (0.0, 0.0, 8.0, 8.0, -4.0, -4.0, 0.0, 0.0))
    spectrum = np.fft.rfft(force)
    spectrum[N // 2 :] = 0.0
    folded = (force - np.fft.irfft(spectrum, N * FINE))[::FINE]
    return force[::FINE] + noise * np.random.default_rng(4).standard_normal(N), folded


def found(force: FloatArray) -> FloatArray:
    key = SMALL.actuators[0].key
    signals = {sensor.key: 1e-3 * np.sin(np.arange(N) / 50.0) for sensor in SMALL.sensors}
    record = Record({**signals, key: force}, FS, "run")
    assert forces_bend(SMALL, [record]) == bool(np.max(np.abs(force)) > 2.0)
    choice = choose_filter(SMALL, [record], cutoff_hz=0.05 * FS)
    simulated = simulated_beside(SMALL, TRUTH, record, choice)
    (effect,) = folded_forces(SMALL)
    return effect.changes(simulated).get(key, np.zeros(N))


def test_a_bend_at_a_sample_is_folded_as_theory_says() -> None:
    force, folded = bent(0.002)
    for cutoff in (0.03, 0.06):
        wanted = zero_phase(folded, 4, cutoff * FS, FS)
        left = zero_phase(found(force), 4, cutoff * FS, FS) - wanted
        assert np.linalg.norm(left) < 0.2 * np.linalg.norm(wanted)


def test_a_smooth_force_and_noise_have_nothing_folded() -> None:
    noise = 0.01 * np.random.default_rng(5).standard_normal(N)
    assert not found(np.sin(2.0 * np.pi * 0.02 * np.arange(N)) + noise).any()
