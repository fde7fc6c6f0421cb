"""What is folded into a force that bends: as large as theory says, and nothing where it does not bend."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.explanation.folded_forces import folded_forces, forces_bend
from modelgen.runtime.iv.companion_simulation import simulated_beside
from modelgen.runtime.least_squares.time_shifts import hold
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


def found(force: FloatArray, held: bool = False, name: str = "fold") -> FloatArray:
    key = SMALL.actuators[0].key
    signals = {sensor.key: 1e-3 * np.sin(np.arange(N) / 50.0) for sensor in SMALL.sensors}
    record = Record({**signals, key: force}, FS, "run")
    if name == "fold":
        assert forces_bend(SMALL, [record]) == bool(np.max(np.abs(force)) > 2.0)
    record = record.edited({key: hold(key)}) if held else record
    choice = choose_filter(SMALL, [record], cutoff_hz=0.05 * FS)
    simulated = simulated_beside(SMALL, TRUTH, record, choice)
    (effect,) = (one for one in folded_forces(SMALL) if one.name == f"{name} of {key}")
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


def test_steps_that_come_half_a_sample_later_take_half_of_each_off_wherever_these_are_now() -> None:
    rng = np.random.default_rng(6)
    steps = np.repeat(rng.choice([-1.0, 1.0], N // 20), 20)
    force = steps + 1e-3 * rng.standard_normal(N)
    for held in (False, True):
        # a step that is a sample later is less by all of it there
        wanted = -0.5 * np.diff(steps, prepend=steps[:1])
        if held:
            wanted = 0.5 * (wanted + np.roll(wanted, 1))
        difference = zero_phase(found(force, held, "instants") - wanted, 4, 0.05 * FS, FS)
        assert np.linalg.norm(difference) < 0.02 * np.linalg.norm(zero_phase(wanted, 4, 0.05 * FS, FS))


def test_a_force_with_few_steps_has_no_instants() -> None:
    force = np.where(np.arange(N) < N // 2, 0.0, 1.0) + 1e-3 * np.random.default_rng(7).standard_normal(N)
    assert not found(force, name="instants").any()
